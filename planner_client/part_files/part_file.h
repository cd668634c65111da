// SPDX-License-Identifier: Apache-2.0
// Part files as people have them: what core/part reads, and STEP.
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "core/part/mesh.h"

namespace sightline {

// Endings of the names of such files, as a list for people: ".step, .stp, .glb, ...".
std::string PartFileEndings();

// The file itself, or of a STEP file its mesh (step_mesh.h), whose unit is the metre.
absl::StatusOr<std::string> MeshFileOf(const std::string& path);

// As LoadPart, also of STEP files, which say their unit themselves. Messages name `path`.
absl::StatusOr<TriangleMesh> LoadPartFile(const std::string& path, const std::string& unit);

}  // namespace sightline
