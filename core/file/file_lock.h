// SPDX-License-Identifier: Apache-2.0
// Locks on files and folders, for exclusive use by one process at a time.
#pragma once

#include <string>
#include <utility>

#include "absl/status/statusor.h"
#include "core/status/stop_check.h"

namespace sightline {

// A lock (flock) on a file or on a folder itself. The kernel releases it when the process ends,
// even by a crash. On a file system without locks it has no effect.
class FileLock {
 public:
  // kShared: other processes may hold a shared lock too.
  enum class Kind { kExclusive, kShared };
  // FAILED_PRECONDITION: another process holds it. NOT_FOUND: there is no such folder.
  static absl::StatusOr<FileLock> TakeFolder(const std::string& folder,
                                             Kind kind = Kind::kExclusive);
  // The file is made (readable by this user alone) if it does not exist. FAILED_PRECONDITION:
  // another process holds it. NOT_FOUND: it cannot be opened.
  static absl::StatusOr<FileLock> TakeFile(const std::string& path, Kind kind = Kind::kExclusive);
  // As TakeFile, but waits until other processes have released it; calls `stop` 20 times a second.
  static absl::StatusOr<FileLock> AwaitFile(const std::string& path, const StopCheck& stop,
                                            Kind kind = Kind::kExclusive);

  FileLock(FileLock&& other) noexcept : descriptor_(std::exchange(other.descriptor_, -1)) {}
  FileLock& operator=(FileLock&& other) noexcept {
    std::swap(descriptor_, other.descriptor_);
    return *this;
  }
  ~FileLock();

  // The open file.
  int descriptor() const { return descriptor_; }

 private:
  explicit FileLock(int descriptor) : descriptor_(descriptor) {}
  static absl::StatusOr<FileLock> Open(const std::string& path, int flags);
  absl::Status Lock(const std::string& path, Kind kind) const;

  int descriptor_ = -1;
};

}  // namespace sightline
