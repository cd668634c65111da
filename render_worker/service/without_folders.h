// SPDX-License-Identifier: Apache-2.0
// Error messages without server paths.
#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"

namespace sightline {

// Removes folders from file names in `message`: "FOLDER/name" becomes "name". Clients know their
// files by their own names and must not see the server's paths. Nested folders are replaced longest
// first.
std::string WithoutFolders(const std::string& message, const std::vector<std::string>& folders);
absl::Status WithoutFolders(const absl::Status& status, const std::vector<std::string>& folders);

}  // namespace sightline
