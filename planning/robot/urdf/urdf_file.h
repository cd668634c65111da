// SPDX-License-Identifier: Apache-2.0
// Reads a URDF file with urdfdom. The library trusts its input and skips unknown words, so hostile
// structure and words outside the specification (urdf_vocabulary.h) are rejected first.
#pragma once

#include <urdf_world/types.h>

#include <set>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace sightline {

struct UrdfFile {
  urdf::ModelInterfaceSharedPtr model;
  std::string digest;                // SHA-256 of the file
  std::vector<std::string> remarks;  // omissions, a sentence each
  // Names of joints whose <limit>, or whose <safety_controller>, states lower or upper limits.
  // urdfdom gives omitted limits the value 0, so its result cannot distinguish them from a stated
  // 0.
  std::set<std::string> joints_with_limits, joints_with_soft_limits;
};

// NOT_FOUND: no such file. INVALID_ARGUMENT names the file and the reason: not a regular file, more
// than 4 MB, document type declarations (entities), elements nested more than 64 deep, text or
// elements behind the root, errors of CheckUrdfVocabulary and of urdfdom.
absl::StatusOr<UrdfFile> ReadUrdfFile(const std::string& path);

}  // namespace sightline
