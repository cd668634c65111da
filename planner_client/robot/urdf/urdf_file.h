// SPDX-License-Identifier: Apache-2.0
// A URDF file read by urdfdom, which trusts its input: what it cannot be given is refused before.
#pragma once

#include <urdf_world/types.h>

#include <string>

#include "absl/status/statusor.h"

namespace sightline {

struct UrdfFile {
  urdf::ModelInterfaceSharedPtr model;
  std::string digest;  // SHA-256 of the file
};

// NOT_FOUND: no such file. INVALID_ARGUMENT names the file and the reason: not a regular file, more
// than 4 MB, document type declarations (entities), elements nested more than 64 deep, what urdfdom
// finds wrong.
absl::StatusOr<UrdfFile> ReadUrdfFile(const std::string& path);

}  // namespace sightline
