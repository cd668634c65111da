// SPDX-License-Identifier: Apache-2.0
#include "core/file/atomic_write.h"

#include <fcntl.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

// Processes of several machines may write into the same folder.
std::string HostName() {
  std::array<char, 256> name{};
  return gethostname(name.data(), name.size() - 1) == 0 ? name.data() : "";
}

// The status that errno stands for.
absl::Status CannotBeWritten(const std::string& path, const char* what) {
  const int error = errno;
  const std::string reason =
      absl::StrCat(path, ": cannot be written: ", what, ": ", std::strerror(error));
  switch (error) {
    case ENOENT:
    case ENOTDIR:
      return absl::NotFoundError(reason);
    case ENOSPC:
    case EDQUOT:
    case EFBIG:
      // A retry cannot succeed until there is more room.
      return absl::ResourceExhaustedError(reason);
    default:
      return absl::UnavailableError(reason);
  }
}

}  // namespace

absl::StatusOr<UnfinishedFile> UnfinishedFile::Make(const std::string& path, mode_t mode) {
  // The temporary file is beside the final one: rename() is atomic only within a file system.
  static std::atomic<int64_t> counter{0};
  std::string temporary =
      absl::StrCat(path, kUnfinishedMark, HostName(), "-", getpid(), "-", counter++);
  const int descriptor =
      open(temporary.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, mode);
  if (descriptor < 0) return CannotBeWritten(path, "open");
  return UnfinishedFile(path, std::move(temporary), descriptor);
}

UnfinishedFile::UnfinishedFile(UnfinishedFile&& other) noexcept
    : path_(std::move(other.path_)),
      temporary_(std::exchange(other.temporary_, "")),
      descriptor_(std::exchange(other.descriptor_, -1)) {}

UnfinishedFile::~UnfinishedFile() {
  if (descriptor_ >= 0) close(descriptor_);
  if (!temporary_.empty()) unlink(temporary_.c_str());
}

absl::Status UnfinishedFile::Failure(const char* what) const {
  return CannotBeWritten(path_, what);
}

absl::Status UnfinishedFile::Write(std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t count = write(descriptor_, bytes.data(), bytes.size());
    if (count < 0) {
      if (errno == EINTR) continue;
      return Failure("write");
    }
    bytes.remove_prefix(static_cast<size_t>(count));
  }
  return absl::OkStatus();
}

absl::Status UnfinishedFile::Commit() {
  // Without this a crash of the machine could leave the new name with empty contents.
  if (fsync(descriptor_) != 0 && errno != EINVAL) return Failure("fsync");
  if (close(std::exchange(descriptor_, -1)) != 0) return Failure("close");
  if (rename(temporary_.c_str(), path_.c_str()) != 0) return Failure("rename");
  temporary_.clear();
  return absl::OkStatus();
}

absl::Status WriteFileAtomically(const std::string& path, std::string_view contents, mode_t mode) {
  SIGHTLINE_ASSIGN_OR_RETURN(UnfinishedFile file, UnfinishedFile::Make(path, mode));
  SIGHTLINE_RETURN_IF_ERROR(file.Write(contents));
  return file.Commit();
}

}  // namespace sightline
