// SPDX-License-Identifier: Apache-2.0
#include "planner_client/command_line/process/exit_code.h"

#include <gtest/gtest.h>

#include <utility>

#include "proto/status/rpc_status.h"

namespace sightline {
namespace {

TEST(ExitCode, TellsRefusedInputFromWorkThatFailed) {
  const absl::Status no_room = absl::ResourceExhaustedError("no space left on device");
  for (const auto& [status, code] :
       {std::pair(absl::InvalidArgumentError("a.json: wrong"), kExitWrongInput),
        std::pair(absl::NotFoundError("a.json: no such file"), kExitWrongInput),
        std::pair(absl::OutOfRangeError("beyond"), kExitWrongInput),
        std::pair(WithErrorInfo(absl::ResourceExhaustedError("large"), "PART_TOO_LARGE"),
                  kExitWrongInput),
        std::pair(no_room, kExitFailed),
        std::pair(WithErrorInfo(no_room, "DISK_FULL"), kExitFailed),
        std::pair(absl::InternalError("bug"), kExitFailed),
        std::pair(absl::CancelledError("Ctrl-C"), kExitInterrupted)}) {
    testing::internal::CaptureStderr();
    EXPECT_EQ(ReportError(status), code) << status;
    testing::internal::GetCapturedStderr();
    EXPECT_EQ(IsRefusedInput(status), code == kExitWrongInput) << status;
  }
}

}  // namespace
}  // namespace sightline
