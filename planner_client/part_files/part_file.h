// SPDX-License-Identifier: Apache-2.0
// Part files as people have them: the formats of core/part, and STEP.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/part/mesh.h"

namespace sightline {

// Endings of the names of such files, as a list for people: ".step, .stp, .glb, ...".
std::string PartFileEndings();

struct PartFileOptions {
  // Take construction geometry for the part. INVALID_ARGUMENT for a file that is no STEP.
  bool construction_geometry = false;
  // Takes remarks: on content of the file that is not in the part, and on choices where the file
  // leaves them open.
  // Null: remarks are written to stderr, so that nothing is left out without a word.
  std::vector<std::string>* remarks = nullptr;
};

struct MeshFile {
  std::string path;
  std::string unit;  // of its lengths; empty if the format says it
};

// The file itself, or of a STEP file its mesh (step_mesh.h). `unit` as of LoadPartFile.
absl::StatusOr<MeshFile> MeshFileOf(const std::string& path, const std::string& unit,
                                    const PartFileOptions& options = {});

// As LoadPart, also of STEP files. `unit` is required for a STEP file that states none, and refused
// for one that does. Messages name `path`.
absl::StatusOr<TriangleMesh> LoadPartFile(const std::string& path, const std::string& unit,
                                          const PartFileOptions& options = {});

// Whether a unit must be given for this file: its format states none, or this STEP file does not.
// False also of a file that cannot be read.
bool NeedsPartUnit(const std::string& path);

}  // namespace sightline
