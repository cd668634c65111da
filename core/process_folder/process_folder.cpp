// SPDX-License-Identifier: Apache-2.0
#include "core/process_folder/process_folder.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <system_error>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

constexpr char kLockFile[] = "/.lock";
constexpr size_t kRandomLetters = 6;
// Most folders that one start checks, so that many folders of other users do not delay it.
constexpr int kMostFoldersSwept = 10000;
// A sweep of another process may take a folder in the moment before it is locked.
constexpr int kMostAttempts = 100;

// An open and locked file, or -1: it is held, or there is none.
int OpenLocked(const std::string& path, int flags) {
  const int fd = open(path.c_str(), O_RDWR | O_CLOEXEC | O_NOFOLLOW | flags, 0600);
  if (fd < 0) return -1;
  if (flock(fd, LOCK_EX | LOCK_NB) == 0) return fd;
  close(fd);
  return -1;
}

// Whether `path` is a folder of ours, and no link to one.
bool IsOwnFolder(const std::string& path) {
  struct stat info {};
  return lstat(path.c_str(), &info) == 0 && S_ISDIR(info.st_mode) && info.st_uid == geteuid();
}

// The lock file is removed last, so that a partly removed folder is found again.
void RemoveTree(const std::string& path) {
  std::error_code error;
  for (fs::directory_iterator it(path, error); !error && it != fs::directory_iterator();
       it.increment(error)) {
    std::error_code ignored;
    if (it->path().filename() != kLockFile + 1) fs::remove_all(it->path(), ignored);
  }
  fs::remove(path + kLockFile, error);
  fs::remove(path, error);
}

void RemoveAbandoned(const std::string& base, const std::string& prefix) {
  std::error_code error;
  int looked_at = 0;
  for (fs::directory_iterator it(base, error); !error && it != fs::directory_iterator();
       it.increment(error)) {
    const std::string name = it->path().filename();
    if (!absl::StartsWith(name, prefix) || name.size() != prefix.size() + kRandomLetters) continue;
    if (++looked_at > kMostFoldersSwept) return;
    const std::string path = it->path();
    if (!IsOwnFolder(path)) continue;
    const int fd = OpenLocked(path + kLockFile, 0);
    if (fd >= 0) {
      RemoveTree(path);
      close(fd);
    } else {
      // Killed before it had a lock; fails for all others, which have one.
      rmdir(path.c_str());
    }
  }
}

}  // namespace

absl::StatusOr<ProcessFolder> ProcessFolder::Make(const std::string& base,
                                                  const std::string& name) {
  const std::string prefix = name + "-";
  RemoveAbandoned(base, prefix);
  for (int attempt = 0; attempt < kMostAttempts; ++attempt) {
    std::string path = absl::StrCat(base, "/", prefix, std::string(kRandomLetters, 'X'));
    if (mkdtemp(path.data()) == nullptr) {
      return absl::InvalidArgumentError(
          absl::StrCat(base, ": no folder can be made there: ", std::strerror(errno)));
    }
    const int fd = OpenLocked(path + kLockFile, O_CREAT | O_EXCL);
    // Gone again if another process swept it between these two calls.
    if (fd >= 0 && access((path + kLockFile).c_str(), F_OK) == 0) {
      return ProcessFolder(std::move(path), fd);
    }
    const int reason = errno;
    if (fd >= 0) close(fd);
    RemoveTree(path);
    if (reason != ENOENT && reason != EWOULDBLOCK) {
      return absl::InvalidArgumentError(
          absl::StrCat(base, ": no file can be made there: ", std::strerror(reason)));
    }
  }
  return absl::InvalidArgumentError(absl::StrCat(base, ": folders made there vanish at once"));
}

ProcessFolder::ProcessFolder(ProcessFolder&& other) noexcept
    : path_(std::exchange(other.path_, "")), lock_fd_(std::exchange(other.lock_fd_, -1)) {}

void ProcessFolder::Remove() {
  if (path_.empty()) return;
  RemoveTree(path_);
  path_.clear();
  close(lock_fd_);
}

std::string TemporaryBase() {
  const char* given = std::getenv("TMPDIR");
  return given != nullptr && *given != '\0' ? given : "/tmp";
}

}  // namespace sightline
