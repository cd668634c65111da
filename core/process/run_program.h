// SPDX-License-Identifier: Apache-2.0
// Runs another program and collects its output.
#pragma once

#include <cstddef>
#include <string>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "core/process/start_process.h"

namespace sightline {

struct FinishedProgram {
  std::string output;   // text that it wrote to stdout
  std::string errors;   // the end of its stderr, at most 4000 bytes
  int wait_status = 0;  // as of waitpid(); 0: it ended well
};

struct ProgramLimits {
  // Limits the time that the program takes by itself (core/process/process_clock.h): CPU time and
  // sleep. A busy machine does not shorten its time.
  absl::Duration time_limit;
  size_t max_output_bytes = size_t{64} << 20;
};

// Runs a program without a shell and collects its output. The program does not outlive the
// call. `start` must not set descriptors 1 and 2. UNAVAILABLE: the program cannot be started;
// DEADLINE_EXCEEDED, RESOURCE_EXHAUSTED: it exceeded the limit on time or output and was ended.
absl::StatusOr<FinishedProgram> RunProgram(ProcessStart start, const ProgramLimits& limits);

}  // namespace sightline
