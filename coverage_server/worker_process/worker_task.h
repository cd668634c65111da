// SPDX-License-Identifier: Apache-2.0
// One long call of a library in a process of its own: libraries cannot be cancelled, but a process
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
  // Reads its input and writes its answer.
  std::function<absl::Status(SharedReader& input, SharedWriter& answer)> run;
};

// Runs the task of that name in a process of `program` and gives its answer, to be read from its
// start; within some 5 ms CANCELLED once *cancelled. The task's own errors; RESOURCE_EXHAUSTED: no
// memory or no process; UNAVAILABLE: the process was killed from outside, again and again.
absl::StatusOr<SharedReader> RunWorkerTask(const std::string& program, const std::string& name,
                                           const SharedMemory& input,
                                           const std::atomic<bool>* cancelled);

// For main(): if this process was started for one of the tasks, does it and returns its exit code.
std::optional<int> MaybeRunWorkerTask(int argc, char** argv, std::span<const WorkerTask> tasks);

}  // namespace sightline
