// SPDX-License-Identifier: Apache-2.0
// Interface to the machines that run the commands of jobs: this machine or those of a cluster.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "planning_service/execution/job_process.h"
#include "planning_service/task/planning_task.h"

namespace sightline {

// One attempt of a job.
struct AttemptOptions {
  std::string name;     // of the job, the same in all its attempts
  std::string program;  // path of `sightline`
  // Absolute path of the job's folder, which all machines of the engine see. Commands run in its
  // folder `in`.
  std::string folder;
  TaskCommands commands;
  // Prepares the folder. Called before any command starts and after all commands of an earlier
  // attempt have ended; not called for an attempt that is resumed. Its error fails the job.
  std::function<absl::Status()> prepare;
  // See JobProcessOptions; only for processes on this machine.
  int lock_fd = -1;
  int64_t max_memory_bytes = 0;  // of each command with all its processes; 0: no limit
  absl::Duration max_time = absl::InfiniteDuration();  // of each command
};

// Decision of the caller about a running attempt.
enum class Wish {
  kGoOn,
  kCancel,
  // The caller leaves. Work that can run without it continues, and a later Run may resume it.
  kLeave,
};
using ProgressCallback = std::function<Wish(const JobProgress&)>;

class ComputeEngine {
 public:
  virtual ~ComputeEngine() = default;

  // Runs the shards, then the conclusion; or resumes the attempt that an earlier Run, of this or
  // another process, has left in the folder. Calls `wish` at least every second. Returns the end of
  // the first command that failed (the others are stopped), else of the conclusion. All commands
  // have ended then, unless the attempt was left. UNAVAILABLE: nothing can be started.
  virtual absl::StatusOr<JobProcessEnd> Run(const AttemptOptions& options,
                                            const ProgressCallback& wish) = 0;
};

// Runs processes on this machine, all shards at the same time; they end with this process.
std::unique_ptr<ComputeEngine> MakeLocalEngine();

}  // namespace sightline
