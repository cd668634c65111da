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

// The same for the folder of a whole command, as long as the result lives: also INVALID_ARGUMENT if
// nothing can be written there, so that this is said before hours of work, and FAILED_PRECONDITION
// if another command writes there at the moment. `kind`: kShared for commands that divide the work.
absl::StatusOr<FileLock> OpenOutputFolder(const std::string& path,
                                          FileLock::Kind kind = FileLock::Kind::kExclusive);

// Removes files of an earlier command that would not belong to the new ones. Those that are
// not there are no error. INTERNAL names the file that cannot be removed.
absl::Status RemoveFiles(const std::string& folder, std::initializer_list<std::string_view> names);

}  // namespace sightline
