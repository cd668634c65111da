// SPDX-License-Identifier: Apache-2.0
// Runs one attempt of a job in a process of its own: crashes do not spread, memory and time are
// limited, and the process ends with this one, even after a crash.
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
  // Folder for temporary files of the process and its servers (TMPDIR), made for this user alone if
  // it does not exist; empty: the temporary folder of this process.
  std::string temporary_folder;
  // Descriptor that stays open in the process and its children: a lock on it is held as long as one
  // of them lives. -1: none.
  int lock_fd = -1;
  int64_t max_memory_bytes = 0;  // of the process and all its children; 0: no limit
  absl::Duration max_time = absl::InfiniteDuration();  // by a steady clock
};

struct JobProcessEnd {
  enum class Kind {
    kDone,         // exit code 0
    kFailed,       // the process stated the reason: `failure`
    kWithoutWord,  // killed, or failed without a stated reason: `failure` says how it ended
    kStopped,      // on request of the caller
    kOutOfMemory,
    kOutOfTime,
  };
  Kind kind = Kind::kWithoutWord;
  // With kWithoutWord: a user or the system ended the process by SIGKILL.
  bool was_killed = false;
  JobFailure failure;
};

// Runs `sightline --progress=json ARGUMENTS` until it ends. Calls `go_on` about every 0.1 s. If
// `go_on` returns false, the process gets SIGTERM, and SIGKILL if it still runs after 5 s.
// UNAVAILABLE: the process cannot be started.
absl::StatusOr<JobProcessEnd> RunJobProcess(const JobProcessOptions& options,
                                            const std::function<bool(const JobProgress&)>& go_on);

}  // namespace sightline
