// SPDX-License-Identifier: Apache-2.0
// A folder of one process, which goes with it, also when it is killed.
#pragma once

#include <string>

#include "absl/status/statusor.h"

namespace sightline {

// A new folder that only this user can enter. It is removed at the end, with all that is in it;
// the next process that makes a folder of the same name there removes what a killed process left.
// Such folders are known by a lock on a file in them, which the kernel gives up
// with the process.
class ProcessFolder {
 public:
  // BASE/NAME-XXXXXX with random letters. Removes abandoned folders of that name first.
  // INVALID_ARGUMENT: no folder can be made there, and why.
  static absl::StatusOr<ProcessFolder> Make(const std::string& base, const std::string& name);

  ProcessFolder(ProcessFolder&& other) noexcept;
  ProcessFolder& operator=(ProcessFolder&&) = delete;
  ~ProcessFolder() { Remove(); }

  // Empty once removed.
  const std::string& path() const { return path_; }
  // Removes it now; what cannot be removed is left to the next process.
  void Remove();

 private:
  ProcessFolder(std::string path, int lock_fd) : path_(std::move(path)), lock_fd_(lock_fd) {}

  std::string path_;
  int lock_fd_ = -1;
};

// TMPDIR of the environment, else /tmp.
std::string TemporaryBase();

}  // namespace sightline
