// SPDX-License-Identifier: Apache-2.0
// Folders that one process at a time uses.
#pragma once

#include <string>
#include <utility>

#include "absl/status/statusor.h"

namespace sightline {

// A lock (flock) on a folder itself; nothing is left in it. The system takes it away when the
// process ends, however that ends. Where the file system has no locks, nothing is locked.
class FolderLock {
 public:
  // kShared: others may share it, too.
  enum class Kind { kExclusive, kShared };
  // FAILED_PRECONDITION: somebody else holds it. NOT_FOUND: there is no such folder.
  static absl::StatusOr<FolderLock> Take(const std::string& folder, Kind kind = Kind::kExclusive);

  FolderLock(FolderLock&& other) noexcept : descriptor_(std::exchange(other.descriptor_, -1)) {}
  FolderLock& operator=(FolderLock&& other) noexcept {
    std::swap(descriptor_, other.descriptor_);
    return *this;
  }
  ~FolderLock();

 private:
  explicit FolderLock(int descriptor) : descriptor_(descriptor) {}
  int descriptor_ = -1;
};

}  // namespace sightline
