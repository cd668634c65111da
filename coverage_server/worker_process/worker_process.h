// SPDX-License-Identifier: Apache-2.0
// Processes of the server's own program that work for it.
#pragma once

#include <sys/types.h>

#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"

namespace sightline {

// The program beside this one or in SIGHTLINE_BIN_DIR that works for it; empty if there is none.
std::string WorkerProgram();

// One process, killed if it still runs when this goes: its result is not wanted any more.
class WorkerProcess {
 public:
  // `arguments` without the program; it keeps the descriptors, under their numbers. The thread that
  // calls must outlive the process: the kernel ends it with that thread, see EndWithParent().
  // RESOURCE_EXHAUSTED: the system gives no more processes.
  static absl::StatusOr<WorkerProcess> Start(const std::string& program,
                                             std::vector<std::string> arguments,
                                             std::span<const int> descriptors);
  WorkerProcess(WorkerProcess&& other) noexcept : pid_(std::exchange(other.pid_, 0)) {}
  WorkerProcess& operator=(WorkerProcess&& other) noexcept {
    std::swap(pid_, other.pid_);
    return *this;
  }
  ~WorkerProcess();

  // How it ended, as of waitpid(); nothing while it runs.
  std::optional<int> Ended();

 private:
  explicit WorkerProcess(pid_t pid) : pid_(pid) {}
  pid_t pid_;
};

}  // namespace sightline
