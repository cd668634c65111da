#include "planner_client/commands/exit_code.h"

#include <cstdio>
#include <nlohmann/json.hpp>
#include <string>

#include "core/json/printable.h"
#include "planner_client/commands/progress_line.h"
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
    std::fprintf(stderr, "sightline: %s\n", Printable(message).c_str());
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
