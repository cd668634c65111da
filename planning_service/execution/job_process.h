// SPDX-License-Identifier: Apache-2.0
// One attempt of a job, as a process of its own: its errors stay in it, its memory and time are
// limited, and it ends with this process, however that ends.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "planning_service/execution/command_messages.h"
#include "planning_service/job_store/planning_job.h"

namespace sightline {

struct JobProcessOptions {
  std::string program;  // path of `sightline`
  std::vector<std::string> arguments;
  std::string folder;  // its working directory
  // Folder of its and its servers' temporary files (TMPDIR), made if it is not there, for this user
  // alone; empty: where this process puts its own.
  std::string temporary_folder;
  // Stays open in the process and its children: a lock on it is theirs as long as one of them
  // lives. -1: none.
  int lock_fd = -1;
  int64_t max_memory_bytes = 0;  // of the process and all its children; 0: no limit
  absl::Duration max_time = absl::InfiniteDuration();  // by a steady clock
};

struct JobProcessEnd {
  enum class Kind {
    kDone,         // exit code 0
    kFailed,       // it said why: `failure`
    kWithoutWord,  // killed, or ended without saying why: `failure` says how
    kStopped,      // was asked to
    kOutOfMemory,
    kOutOfTime,
  };
  Kind kind = Kind::kWithoutWord;
  // kWithoutWord: ended by SIGKILL, which a process never sends itself; a user or the system did.
  bool was_killed = false;
  JobFailure failure;
};

// Runs `sightline --progress=json ARGUMENTS` until it ends. `go_on` is called every 0.1 s or so;
// when it returns false the process is asked to stop (SIGTERM) and killed when it does not within 5
// s. UNAVAILABLE: it cannot be started.
absl::StatusOr<JobProcessEnd> RunJobProcess(const JobProcessOptions& options,
                                            const std::function<bool(const JobProgress&)>& go_on);

}  // namespace sightline
