// SPDX-License-Identifier: Apache-2.0
// A program of another package, run for its answer.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"

namespace sightline {

struct SubprocessResult {
  int exit_code = 0;  // 128 + signal if it was killed by one
  std::string output;
  std::string errors;
};

// Runs a program, found in PATH unless its name has a '/'. UNAVAILABLE: it
// cannot be started, does not end within `timeout`, or says more than 64 MiB.
absl::StatusOr<SubprocessResult> RunSubprocess(const std::vector<std::string>& words,
                                               absl::Duration timeout);

}  // namespace sightline
