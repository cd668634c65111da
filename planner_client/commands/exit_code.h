// Exit codes of the sightline command and how errors become them.
#pragma once

#include <cstdio>

#include "absl/status/status.h"

namespace sightline {

inline constexpr int kExitDone = 0;
inline constexpr int kExitFailed = 1;         // failed while running
inline constexpr int kExitWrongInput = 2;     // the message names file, field and reason
inline constexpr int kExitInterrupted = 130;  // what was finished is kept

// Prints the error and returns its exit code.
inline int ReportError(const absl::Status& status) {
  std::fprintf(stderr, "sightline: %s\n", std::string(status.message()).c_str());
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
