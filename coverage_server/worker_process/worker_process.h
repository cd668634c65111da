// SPDX-License-Identifier: Apache-2.0
// Worker processes: processes of the server's own program.
#pragma once

#include <sys/types.h>

#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"

namespace sightline {

// Path of the program for worker processes, beside this one or in SIGHTLINE_BIN_DIR; empty: none.
std::string WorkerProgram();

// One process. The destructor kills it if it still runs: its result is not needed any more.
class WorkerProcess {
 public:
  // `arguments` without the program. The process inherits the descriptors under the same numbers.
  // The calling thread must outlive the process: the kernel ends the process with that thread, see
  // EndWithParent(). RESOURCE_EXHAUSTED: no more processes are possible.
  static absl::StatusOr<WorkerProcess> Start(const std::string& program,
                                             std::vector<std::string> arguments,
                                             std::span<const int> descriptors);
  WorkerProcess(WorkerProcess&& other) noexcept : pid_(std::exchange(other.pid_, 0)) {}
  WorkerProcess& operator=(WorkerProcess&& other) noexcept {
    std::swap(pid_, other.pid_);
    return *this;
  }
  ~WorkerProcess();

  // Status of the ended process, as by waitpid(); nullopt while it runs.
  std::optional<int> Ended();

 private:
  explicit WorkerProcess(pid_t pid) : pid_(pid) {}
  pid_t pid_;
};

}  // namespace sightline
