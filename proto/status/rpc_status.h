// SPDX-License-Identifier: Apache-2.0
// absl::Status on both ends of an RPC, with google.rpc details (https://google.aip.dev/193).
//
// Details travel inside an absl::Status as payloads keyed by their type URL, so code between the
// edge and the library never sees gRPC types.
#pragma once

#include <grpcpp/support/status.h>

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/time/time.h"

namespace sightline {

// Domain of every ErrorInfo of this project.
inline constexpr char kErrorDomain[] = "sightline";

// Reasons that clients act on.
inline constexpr char kReasonPartUnknown[] = "PART_UNKNOWN";
inline constexpr char kReasonSceneUnknown[] = "SCENE_UNKNOWN";

struct FieldViolation {
  std::string field;        // path, e.g. "measurements[3].camera_distance_m"
  std::string description;  // value and allowed range

  friend bool operator==(const FieldViolation&, const FieldViolation&) = default;
};

// `status` with an ErrorInfo. OK stays OK.
absl::Status WithErrorInfo(absl::Status status, const std::string& reason,
                           const std::map<std::string, std::string>& metadata = {});

// `status` with a RetryInfo.
absl::Status WithRetryDelay(absl::Status status, absl::Duration delay);

// INVALID_ARGUMENT with a BadRequest; OK if there are no violations. Only the first ten are sent:
// trailers are limited to 8 KiB.
absl::Status InvalidFields(const std::vector<FieldViolation>& violations);

// Adds an ErrorInfo (reason: name of the code) where there is none; messages are cut at 1000 bytes
// and made valid UTF-8.
grpc::Status ToGrpcStatus(const absl::Status& status);
// The inverse; unreadable details are dropped.
absl::Status FromGrpcStatus(const grpc::Status& status);

// Reason of the ErrorInfo if its domain is ours; else empty.
std::string ErrorReason(const absl::Status& status);
std::map<std::string, std::string> ErrorMetadata(const absl::Status& status);
std::vector<FieldViolation> FieldViolations(const absl::Status& status);
std::optional<absl::Duration> RetryDelay(const absl::Status& status);

}  // namespace sightline
