// SPDX-License-Identifier: Apache-2.0
// Exit codes of the sightline command and how errors become them.
#pragma once

#include "absl/status/status.h"

namespace sightline {

inline constexpr int kExitDone = 0;
inline constexpr int kExitFailed = 1;         // failed while running
inline constexpr int kExitWrongInput = 2;     // the message names file, field and reason
inline constexpr int kExitInterrupted = 130;  // finished results are kept

// Whether the input is refused: it is wrong, is missing or exceeds a limit (reasons such as
// PART_TOO_LARGE). Otherwise the work failed: no memory, no disk space, no server.
bool IsRefusedInput(const absl::Status& status);

// Prints the error, as text or JSON (progress_line.h), and returns its exit code.
int ReportError(const absl::Status& status);

}  // namespace sightline
