// SPDX-License-Identifier: Apache-2.0
// A folder of one process that is removed with it, even if the process was killed.
#pragma once

#include <string>

#include "absl/status/statusor.h"

namespace sightline {

// A new folder that only this user can enter. The destructor removes it with its contents. The
// next process that makes a folder of the same name removes folders of killed processes. It
// recognises them by a lock on a file in them, which the kernel releases with the
// process.
class ProcessFolder {
 public:
  // Makes BASE/NAME-XXXXXX with random letters, after removing abandoned folders of that name.
  // INVALID_ARGUMENT states why no folder can be made there.
  static absl::StatusOr<ProcessFolder> Make(const std::string& base, const std::string& name);

  ProcessFolder(ProcessFolder&& other) noexcept;
  ProcessFolder& operator=(ProcessFolder&&) = delete;
  ~ProcessFolder() { Remove(); }

  // Empty once removed.
  const std::string& path() const { return path_; }
  // Removes the folder now; the next process removes files that cannot be removed now.
  void Remove();

 private:
  ProcessFolder(std::string path, int lock_fd) : path_(std::move(path)), lock_fd_(lock_fd) {}

  std::string path_;
  int lock_fd_ = -1;
};

// TMPDIR of the environment, else /tmp.
std::string TemporaryBase();

}  // namespace sightline
