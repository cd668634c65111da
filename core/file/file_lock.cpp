// SPDX-License-Identifier: Apache-2.0
#include "core/file/file_lock.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

constexpr absl::Duration kLockPollInterval = absl::Milliseconds(50);
constexpr int kLockFileFlags = O_RDWR | O_CREAT | O_NOFOLLOW;

}  // namespace

absl::StatusOr<FileLock> FileLock::Open(const std::string& path, int flags) {
  const int descriptor = open(path.c_str(), flags | O_CLOEXEC, 0600);
  if (descriptor < 0) {
    return absl::NotFoundError(absl::StrCat(path, ": cannot be opened: ", std::strerror(errno)));
  }
  return FileLock(descriptor);
}

absl::Status FileLock::Lock(const std::string& path, Kind kind) const {
  const int operation = (kind == Kind::kShared ? LOCK_SH : LOCK_EX) | LOCK_NB;
  int result = 0;
  do {
    result = flock(descriptor_, operation);
  } while (result != 0 && errno == EINTR);
  if (result != 0 && errno == EWOULDBLOCK) {
    return absl::FailedPreconditionError(
        absl::StrCat(path, ": is in use by another process of this program"));
  }
  return absl::OkStatus();
}

absl::StatusOr<FileLock> FileLock::TakeFolder(const std::string& folder, Kind kind) {
  SIGHTLINE_ASSIGN_OR_RETURN(FileLock lock, Open(folder, O_RDONLY | O_DIRECTORY));
  SIGHTLINE_RETURN_IF_ERROR(lock.Lock(folder, kind));
  return lock;
}

absl::StatusOr<FileLock> FileLock::TakeFile(const std::string& path, Kind kind) {
  SIGHTLINE_ASSIGN_OR_RETURN(FileLock lock, Open(path, kLockFileFlags));
  SIGHTLINE_RETURN_IF_ERROR(lock.Lock(path, kind));
  return lock;
}

absl::StatusOr<FileLock> FileLock::AwaitFile(const std::string& path, const StopCheck& stop,
                                             Kind kind) {
  SIGHTLINE_ASSIGN_OR_RETURN(FileLock lock, Open(path, kLockFileFlags));
  while (true) {
    absl::Status status = lock.Lock(path, kind);
    if (status.ok()) return lock;
    SIGHTLINE_RETURN_IF_ERROR(CheckStop(stop));
    absl::SleepFor(kLockPollInterval);
  }
}

FileLock::~FileLock() {
  if (descriptor_ >= 0) close(descriptor_);
}

}  // namespace sightline
