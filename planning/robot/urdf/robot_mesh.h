// SPDX-License-Identifier: Apache-2.0
// Meshes of a robot's links.
#pragma once

#include <Eigen/Core>
#include <string>

#include "absl/status/statusor.h"
#include "core/part/mesh.h"

namespace sightline {

// Loads a part file (core/part/load_part.h) whose coordinates times `scale` are metres. A scale
// with an odd number of negative factors mirrors: triangles are reversed so that normals still
// point outwards. INVALID_ARGUMENT: a scale that is 0 or not finite, a mesh below 1 mm or above 10
// m, and errors of LoadPart.
absl::StatusOr<TriangleMesh> LoadRobotMesh(const std::string& path, const Eigen::Vector3d& scale);

}  // namespace sightline
