// SPDX-License-Identifier: Apache-2.0
#include "planner_client/part_files/private_folder.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <mutex>
#include <optional>
#include <system_error>
#include <utility>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/str_cat.h"
#include "core/process_folder/process_folder.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

constexpr mode_t kPrivateFolder = 0700;

absl::Status UnusableFolder(const std::string& folder, const std::string& reason) {
  return absl::InvalidArgumentError(absl::StrCat(folder, ": ", reason));
}

// The folder that an environment variable names; empty unless it is absolute.
fs::path FolderFrom(const char* variable) {
  const char* value = std::getenv(variable);
  const fs::path path = value == nullptr ? "" : value;
  return path.is_absolute() ? path : fs::path();
}

}  // namespace

absl::Status MakePrivateFolder(const std::string& folder) {
  std::error_code error;
  if (const fs::path above = fs::path(folder).parent_path(); !above.empty()) {
    fs::create_directories(above, error);
  }
  if (mkdir(folder.c_str(), kPrivateFolder) != 0 && errno != EEXIST) {
    return UnusableFolder(folder, absl::StrCat("cannot be made: ", std::strerror(errno)));
  }
  const int descriptor = open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (descriptor < 0) return UnusableFolder(folder, std::strerror(errno));
  const auto close_it = absl::MakeCleanup([&] { close(descriptor); });
  struct stat info {};
  if (fstat(descriptor, &info) != 0) return UnusableFolder(folder, std::strerror(errno));
  if (info.st_uid != geteuid()) return UnusableFolder(folder, "belongs to another user");
  if ((info.st_mode & 0777) != kPrivateFolder && fchmod(descriptor, kPrivateFolder) != 0) {
    return UnusableFolder(folder, absl::StrCat("cannot be made private: ", std::strerror(errno)));
  }
  if (access(folder.c_str(), W_OK | X_OK) != 0) {
    return UnusableFolder(folder, absl::StrCat("cannot be written: ", std::strerror(errno)));
  }
  return absl::OkStatus();
}

absl::StatusOr<std::string> UserCacheFolder(const std::string& name) {
  const fs::path home = FolderFrom("HOME");
  for (const fs::path& base :
       {FolderFrom("XDG_CACHE_HOME"), home.empty() ? home : home / ".cache"}) {
    if (base.empty()) continue;
    const std::string folder = (base / "sightline" / name).string();
    if (MakePrivateFolder(folder).ok()) return folder;
  }
  static std::mutex mutex;
  static std::optional<ProcessFolder> own;
  const std::lock_guard lock(mutex);
  if (!own) {
    SIGHTLINE_ASSIGN_OR_RETURN(auto made, ProcessFolder::Make(TemporaryBase(), "sightline-cache"));
    own.emplace(std::move(made));
  }
  const std::string folder = absl::StrCat(own->path(), "/", name);
  SIGHTLINE_RETURN_IF_ERROR(MakePrivateFolder(folder));
  return folder;
}

void RemoveUnusedFiles(const std::string& folder) {
  constexpr auto kKeptUnused = std::chrono::hours(24 * 30);
  std::error_code error;
  const auto now = fs::file_time_type::clock::now();
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
    std::error_code gone;
    if (now - entry.last_write_time(gone) > kKeptUnused && !gone) fs::remove(entry.path(), gone);
  }
}

}  // namespace sightline
