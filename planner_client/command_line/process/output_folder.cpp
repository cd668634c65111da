// SPDX-License-Identifier: Apache-2.0
#include "planner_client/command_line/process/output_folder.h"

#include <unistd.h>

#include <filesystem>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "core/file/atomic_write.h"
#include "core/status/status_macros.h"

namespace sightline {

absl::Status MakeOutputFolder(const std::string& path) {
  std::error_code error;
  std::filesystem::create_directories(path, error);
  if (!error) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat("cannot make folder ", path, ": ", error.message()));
}

absl::StatusOr<FileLock> OpenOutputFolder(const std::string& path, FileLock::Kind kind) {
  SIGHTLINE_RETURN_IF_ERROR(MakeOutputFolder(path));
  absl::StatusOr<FileLock> lock = FileLock::TakeFolder(path, kind);
  if (absl::IsFailedPrecondition(lock.status())) {
    return absl::FailedPreconditionError(
        absl::StrCat("--out ", path,
                     ": another sightline command is writing there at the moment; wait for it or "
                     "give another folder"));
  }
  if (!lock.ok())
    return absl::InvalidArgumentError(absl::StrCat("--out ", lock.status().message()));
  // Tries to write, since permissions do not show full or read-only file systems.
  const std::string trial = absl::StrCat(path, "/.sightline-trial-", getpid());
  if (absl::Status written = WriteFileAtomically(trial, "\n"); !written.ok()) {
    return absl::InvalidArgumentError(
        absl::StrCat("--out ", path, ": nothing can be written there: ", written.message()));
  }
  std::error_code ignored;
  std::filesystem::remove(trial, ignored);
  return lock;
}

absl::Status RemoveFiles(const std::string& folder, std::initializer_list<std::string_view> names) {
  for (const std::string_view name : names) {
    const std::filesystem::path path = std::filesystem::path(folder) / name;
    std::error_code error;
    std::filesystem::remove(path, error);
    if (!error) continue;
    return absl::InternalError(
        absl::StrCat(path.string(), ": of an earlier plan, cannot be removed: ", error.message()));
  }
  return absl::OkStatus();
}

}  // namespace sightline
