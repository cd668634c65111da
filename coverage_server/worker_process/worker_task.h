// SPDX-License-Identifier: Apache-2.0
// Runs a long call of a library in a separate process. Libraries cannot be cancelled, but a process
// can be killed at any moment, and its memory is freed.
#pragma once

#include <atomic>
#include <functional>
#include <optional>
#include <span>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "coverage_server/worker_process/shared_memory.h"

namespace sightline {

struct WorkerTask {
  std::string name;
  // Reads the input of the task and writes its answer.
  std::function<absl::Status(SharedReader& input, SharedWriter& answer)> run;
};

// Runs the task `name` in a process of `program`; returns a reader at the start of its answer.
// Errors of the task itself; CANCELLED within about 5 ms of *cancelled; RESOURCE_EXHAUSTED: no
// memory or no process; UNAVAILABLE: the process was killed by a signal three times.
absl::StatusOr<SharedReader> RunWorkerTask(const std::string& program, const std::string& name,
                                           const SharedMemory& input,
                                           const std::atomic<bool>* cancelled);

// To be called by main(). If this process was started for one of the tasks, runs the task and
// returns the exit code; else nullopt.
std::optional<int> MaybeRunWorkerTask(int argc, char** argv, std::span<const WorkerTask> tasks);

}  // namespace sightline
