// SPDX-License-Identifier: Apache-2.0
// Another program as a child of this one.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"

namespace sightline {

struct FinishedProgram {
  std::string output;  // what it wrote to stdout, at most 512 MiB
  std::string errors;  // the end of what it wrote to stderr
  int wait_status = 0;
};

// Runs a program without a shell, its standard input empty, and collects what it writes. The child
// does not outlive the call. DEADLINE_EXCEEDED: it was ended; INTERNAL: it could not be started or
// wrote too much.
absl::StatusOr<FinishedProgram> RunProgram(const std::string& program,
                                           std::vector<std::string> arguments,
                                           absl::Duration time_limit);

}  // namespace sightline
