// SPDX-License-Identifier: Apache-2.0
#include "planner_client/commands/process/exit_code.h"

#include <cstdio>
#include <nlohmann/json.hpp>
#include <string>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "core/json/printable.h"
#include "planner_client/commands/process/progress_line.h"
#include "proto/status/rpc_status.h"

namespace sightline {

int ReportError(const absl::Status& status) {
  const std::string message(status.message());
  if (UsesJsonProgress()) {
    const nlohmann::json line = {{"error",
                                  {{"code", absl::StatusCodeToString(status.code())},
                                   {"reason", ErrorReason(status)},
                                   {"message", message}}}};
    std::fprintf(stderr, "%s\n",
                 line.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace).c_str());
  } else {
    // Where there are several errors, each has a line of its own (core/json/error_list.h).
    const bool several = message.find('\n') != std::string::npos;
    const std::string shown = several ? absl::StrCat("several errors:\n  ",
                                                     absl::StrReplaceAll(message, {{"\n", "\n  "}}))
                                      : message;
    std::fprintf(stderr, "sightline: %s\n", Printable(shown).c_str());
  }
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
