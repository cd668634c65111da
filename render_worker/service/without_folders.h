// SPDX-License-Identifier: Apache-2.0
// Errors as clients may read them.
#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"

namespace sightline {

// `message` with files named as they are in the folders: "FOLDER/name" becomes "name". Clients know
// their files by their own names, and where a server keeps its files is none of their business.
// Longer folders first where one lies in another.
std::string WithoutFolders(const std::string& message, const std::vector<std::string>& folders);
absl::Status WithoutFolders(const absl::Status& status, const std::vector<std::string>& folders);

}  // namespace sightline
