// SPDX-License-Identifier: Apache-2.0
// Exit codes of the sightline command, and their mapping from errors.
#pragma once

#include "absl/status/status.h"

namespace sightline {

inline constexpr int kExitDone = 0;
inline constexpr int kExitFailed = 1;         // failed while running
inline constexpr int kExitWrongInput = 2;     // the message names file, field and reason
inline constexpr int kExitInterrupted = 130;  // finished results are kept

// True if the input is rejected: it is wrong, missing or exceeds a limit (reasons such as
// PART_TOO_LARGE). False if the work failed: no memory, no disk space, no server.
bool IsRefusedInput(const absl::Status& status);

// Prints the error, as text or JSON (progress_line.h), and returns its exit code.
int ReportError(const absl::Status& status);

}  // namespace sightline
