// SPDX-License-Identifier: Apache-2.0
// Folders that only this user can enter.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace sightline {

// Makes the folder with mode 0700, and those above it if they are missing. A folder that exists
// gets this mode. INVALID_ARGUMENT names the folder: it cannot be made or written, or it belongs to
// another user.
absl::Status MakePrivateFolder(const std::string& folder);

// $XDG_CACHE_HOME/sightline/NAME, else ~/.cache/sightline/NAME; if neither is usable, a folder of
// this process that is removed when it ends. INVALID_ARGUMENT if that one cannot be made either.
absl::StatusOr<std::string> UserCacheFolder(const std::string& name);

// Removes the files of a cache that were last written or touched more than 30 days ago.
void RemoveUnusedFiles(const std::string& folder);

}  // namespace sightline
