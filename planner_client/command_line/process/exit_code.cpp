// SPDX-License-Identifier: Apache-2.0
#include "planner_client/command_line/process/exit_code.h"

#include <string>

#include "absl/strings/match.h"
#include "planner_client/command_line/process/error_line.h"
#include "proto/status/rpc_status.h"

namespace sightline {

bool IsRefusedInput(const absl::Status& status) {
  return absl::IsInvalidArgument(status) || absl::IsNotFound(status) ||
         absl::IsOutOfRange(status) || absl::EndsWith(ErrorReason(status), "_TOO_LARGE");
}

int ReportError(const absl::Status& status) {
  PrintError(absl::StatusCodeToString(status.code()), ErrorReason(status),
             std::string(status.message()));
  if (IsRefusedInput(status)) return kExitWrongInput;
  return absl::IsCancelled(status) ? kExitInterrupted : kExitFailed;
}

}  // namespace sightline
