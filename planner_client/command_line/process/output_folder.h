// SPDX-License-Identifier: Apache-2.0
// Output folders of commands.
#pragma once

#include <initializer_list>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/file/file_lock.h"

namespace sightline {

// Makes the folder and those above it. INVALID_ARGUMENT names the folder and the reason.
absl::Status MakeOutputFolder(const std::string& path);

// As MakeOutputFolder, and locks the folder while the result lives. Also
// INVALID_ARGUMENT if the folder is not writable, to fail before hours of work, and
// FAILED_PRECONDITION if another command is writing there. `kind`: kShared for commands
// that divide the work.
absl::StatusOr<FileLock> OpenOutputFolder(const std::string& path,
                                          FileLock::Kind kind = FileLock::Kind::kExclusive);

// Removes files of an earlier command that do not belong to the new ones. Missing files are no
// error. INTERNAL names the file that cannot be removed.
absl::Status RemoveFiles(const std::string& folder, std::initializer_list<std::string_view> names);

}  // namespace sightline
