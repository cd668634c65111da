// SPDX-License-Identifier: Apache-2.0
#include "planning_service/http/http_reply.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/time/time.h"
#include "proto/status/rpc_status.h"

namespace sightline {
namespace {

using nlohmann::ordered_json;

// Text from outside may not be UTF-8; JSON must be.
std::string Dump(const ordered_json& tree) {
  return tree.dump(-1, ' ', false, ordered_json::error_handler_t::replace);
}

}  // namespace

int HttpStatusOf(const absl::Status& status) {
  const std::string reason = ErrorReason(status);
  switch (status.code()) {
    case absl::StatusCode::kOk:
      return 200;
    case absl::StatusCode::kInvalidArgument:
      return reason == "MEDIA_TYPE_NOT_SUPPORTED" ? 415 : 400;
    case absl::StatusCode::kOutOfRange:
      return reason == "RANGE_NOT_SATISFIABLE" ? 416 : 400;
    case absl::StatusCode::kFailedPrecondition:
      return reason == "JOB_NOT_FINISHED" ? 409 : 400;
    case absl::StatusCode::kUnauthenticated:
      return 401;
    case absl::StatusCode::kPermissionDenied:
      return 403;
    case absl::StatusCode::kNotFound:
      return 404;
    case absl::StatusCode::kUnimplemented:
      return reason == "METHOD_NOT_ALLOWED" ? 405 : 501;
    case absl::StatusCode::kAlreadyExists:
    case absl::StatusCode::kAborted:
      return 409;
    case absl::StatusCode::kResourceExhausted:
      if (reason == "DISK_FULL") return 507;
      if (reason == "UPLOAD_TOO_LARGE" || reason == "REQUEST_TOO_LARGE") return 413;
      if (reason == "HEADERS_TOO_LARGE") return 431;
      if (reason == "TOO_MANY_CONNECTIONS" || reason == "TOO_MANY_EVENT_STREAMS") return 503;
      return 429;
    case absl::StatusCode::kUnavailable:
      return 503;
    case absl::StatusCode::kDeadlineExceeded:
      return reason == "REQUEST_TIMEOUT" ? 408 : 504;
    default:
      return 500;
  }
}

std::string ErrorJson(const absl::Status& status) {
  ordered_json error;
  error["code"] = absl::StatusCodeToString(status.code());
  const std::string reason = ErrorReason(status);
  error["reason"] = reason.empty() ? absl::StatusCodeToString(status.code()) : reason;
  error["message"] = std::string(status.message());
  error["fields"] = ordered_json::array();
  for (const FieldViolation& violation : FieldViolations(status)) {
    error["fields"].push_back({{"field", violation.field}, {"description", violation.description}});
  }
  return Dump({{"error", std::move(error)}});
}

void ReplyText(HttpExchange& exchange, int http_status, const HttpHeaders& headers,
               const std::string& content_type, absl::string_view body) {
  HttpHeaders all = headers;
  if (!content_type.empty()) all.emplace_back("Content-Type", content_type);
  absl::Status status = exchange.Begin(http_status, all, static_cast<int64_t>(body.size()));
  if (status.ok()) status = exchange.Write(body);
  if (status.ok()) status = exchange.End();
  status.IgnoreError();
}

void ReplyJson(HttpExchange& exchange, int http_status, const std::string& json,
               const HttpHeaders& headers) {
  HttpHeaders all = headers;
  all.emplace_back("Cache-Control", "no-store");
  ReplyText(exchange, http_status, all, "application/json", json + "\n");
}

void ReplyError(HttpExchange& exchange, const absl::Status& status, const HttpHeaders& headers) {
  HttpHeaders all = headers;
  const int http_status = HttpStatusOf(status);
  if (http_status == 401) all.emplace_back("WWW-Authenticate", "Bearer realm=\"sightline\"");
  if (http_status == 429 || http_status == 503) {
    // A quota becomes free when jobs end, after minutes; an overload passes sooner.
    const absl::Duration usual = absl::Seconds(http_status == 429 ? 30 : 5);
    const double delay_s = absl::ToDoubleSeconds(RetryDelay(status).value_or(usual));
    all.emplace_back(
        "Retry-After",
        absl::StrCat(static_cast<int64_t>(std::clamp(std::ceil(delay_s), 1.0, 3600.0))));
  }
  ReplyJson(exchange, http_status, ErrorJson(status), all);
}

}  // namespace sightline
