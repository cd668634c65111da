// SPDX-License-Identifier: Apache-2.0
// Measures the time that another process takes by itself, for limits that are independent of the
// load of the machine. A running process takes its CPU time. A sleeping process (waiting for a
// timer, a lock, the network) takes the time that passes. A process that is ready to run or waits
// for the disk is delayed by the machine and takes no time. The kernel reports the states of
// threads and the CPU time: proc_pid_stat(5), clock_getcpuclockid(3).
//
//   ProcessClock clock(pid);
//   while (!Ended(pid)) {
//     if (clock.Look() > limit) return absl::DeadlineExceededError("...");
//     absl::SleepFor(ProcessClock::kPeriod);
//   }
#pragma once

#include <sys/types.h>

#include <chrono>

#include "absl/time/time.h"

namespace sightline {

class ProcessClock {
 public:
  // Interval at which callers call Look. The state at a call counts for the time since the call
  // before, up to a second: a caller that was delayed itself does not know the states in between.
  static constexpr absl::Duration kPeriod = absl::Milliseconds(100);

  // Starts at 0. `pid` is a child that has not been waited for.
  explicit ProcessClock(pid_t pid);

  // Looks at the process, at most every 2 ms. Returns the time that the process has taken since the
  // clock was made; this is at most the wall time. Children of the process do not count: it sleeps
  // while it waits for them.
  absl::Duration Look();

 private:
  const pid_t pid_;
  absl::Duration cpu_time_;
  std::chrono::steady_clock::time_point looked_at_;
  absl::Duration taken_;
};

}  // namespace sightline
