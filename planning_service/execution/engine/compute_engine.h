// SPDX-License-Identifier: Apache-2.0
// The machines on which the commands of jobs run: on this machine, or on the machines of a cluster.
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
  // Makes the folder ready: called before any command begins, once none of an attempt before runs
  // any more; not for an attempt that is taken up again. Its error is the job's.
  std::function<absl::Status()> prepare;
  // See JobProcessOptions; of processes on this machine.
  int lock_fd = -1;
  int64_t max_memory_bytes = 0;  // of each command with all its processes; 0: no limit
  absl::Duration max_time = absl::InfiniteDuration();  // of each command
};

// The caller's wish for an attempt.
enum class Wish {
  kGoOn,
  kCancel,
  // The caller leaves. Work that can run on without it does, and may be found again.
  kLeave,
};
using ProgressCallback = std::function<Wish(const JobProgress&)>;

class ComputeEngine {
 public:
  virtual ~ComputeEngine() = default;

  // Runs the parts, then the conclusion, or takes up the attempt that an earlier Run, of this
  // process or another one, has left in the folder. Returns how it ended: as the first command that
  // did not end well, whose fellows are ended then. No command of the attempt runs any more, unless
  // it was left. Asks `wish` every second or oftener. UNAVAILABLE: nothing can be started.
  virtual absl::StatusOr<JobProcessEnd> Run(const AttemptOptions& options,
                                            const ProgressCallback& wish) = 0;
};

// Processes on this machine, all parts at the same time; they end with this process.
std::unique_ptr<ComputeEngine> MakeLocalEngine();

}  // namespace sightline
