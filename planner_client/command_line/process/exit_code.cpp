// SPDX-License-Identifier: Apache-2.0
#include "planner_client/command_line/process/exit_code.h"

#include <string>

#include "planner_client/command_line/process/error_line.h"
#include "proto/status/rpc_status.h"

namespace sightline {

int ReportError(const absl::Status& status) {
  PrintError(absl::StatusCodeToString(status.code()), ErrorReason(status),
             std::string(status.message()));
  switch (status.code()) {
    case absl::StatusCode::kInvalidArgument:
    case absl::StatusCode::kNotFound:
    case absl::StatusCode::kOutOfRange:
      return kExitWrongInput;
    case absl::StatusCode::kCancelled:
      return kExitInterrupted;
    default:
      return kExitFailed;
  }
}

}  // namespace sightline
