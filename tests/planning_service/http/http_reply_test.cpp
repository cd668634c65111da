// SPDX-License-Identifier: Apache-2.0
#include "planning_service/http/http_reply.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <vector>

#include "core/json/message_json.h"
#include "proto/status/rpc_status.h"
#include "sightline/v1/planning_service.pb.h"

namespace sightline {
namespace {

TEST(HttpStatusOf, FollowsCodeAndReason) {
  struct Case {
    absl::StatusCode code;
    const char* reason;
    int http_status;
  };
  using enum absl::StatusCode;
  const std::vector<Case> cases = {
      {kInvalidArgument, "INVALID_FIELD", 400},
      {kInvalidArgument, "MEDIA_TYPE_NOT_SUPPORTED", 415},
      {kOutOfRange, "RANGE_NOT_SATISFIABLE", 416},
      {kFailedPrecondition, "JOB_NOT_FINISHED", 409},
      {kFailedPrecondition, "OTHER", 400},
      {kUnauthenticated, "CREDENTIALS_UNKNOWN", 401},
      {kPermissionDenied, "KIND_NOT_ALLOWED", 403},
      {kNotFound, "JOB_UNKNOWN", 404},
      {kUnimplemented, "METHOD_NOT_ALLOWED", 405},
      {kUnimplemented, "OTHER", 501},
      {kDeadlineExceeded, "REQUEST_TIMEOUT", 408},
      {kDeadlineExceeded, "OTHER", 504},
      {kAlreadyExists, "REQUEST_ID_REUSED", 409},
      {kAborted, "OTHER", 409},
      {kResourceExhausted, "UPLOAD_TOO_LARGE", 413},
      {kResourceExhausted, "REQUEST_TOO_LARGE", 413},
      {kResourceExhausted, "HEADERS_TOO_LARGE", 431},
      {kResourceExhausted, "QUOTA_EXCEEDED", 429},
      {kResourceExhausted, "DISK_FULL", 507},
      {kResourceExhausted, "TOO_MANY_CONNECTIONS", 503},
      {kUnavailable, "OTHER", 503},
      {kInternal, "OTHER", 500},
      {kDataLoss, "OTHER", 500},
      {kUnknown, "OTHER", 500},
  };
  for (const Case& c : cases) {
    const absl::Status status = WithErrorInfo(absl::Status(c.code, "x"), c.reason);
    EXPECT_EQ(HttpStatusOf(status), c.http_status) << status;
  }
}

TEST(ErrorJson, NamesCodeReasonAndFields) {
  const auto json = nlohmann::json::parse(ErrorJson(InvalidFields({{"task.kind", "is missing"}})));
  EXPECT_EQ(json, nlohmann::json::parse(R"({"error": {"code": "INVALID_ARGUMENT",
      "reason": "INVALID_FIELD", "message": "task.kind: is missing",
      "fields": [{"field": "task.kind", "description": "is missing"}]}})"));
  const auto plain = nlohmann::json::parse(ErrorJson(absl::InternalError("bad \xff byte")));
  EXPECT_EQ(plain["error"]["reason"], "INTERNAL");
  EXPECT_EQ(plain["error"]["fields"], nlohmann::json::array());
}

TEST(MessageJson, HasAllFieldsAndTimes) {
  v1::PlanningJob job;
  job.set_job_id("j1");
  job.set_state(v1::PlanningJob::SUCCEEDED);
  job.mutable_created_at()->set_seconds(1700000000);
  job.mutable_created_at()->set_nanos(500000000);
  v1::JobFile* result = job.add_results();
  result->set_name("plan.json");
  result->set_size_bytes(int64_t{1} << 40);
  const std::string text = MessageJson(job);
  EXPECT_EQ(text.find('\n'), std::string::npos);
  const auto json = nlohmann::json::parse(text);
  EXPECT_EQ(json["job_id"], "j1");
  EXPECT_EQ(json["state"], "SUCCEEDED");
  EXPECT_EQ(json["progress"], 0.0);
  EXPECT_EQ(json["created_at"], "2023-11-14T22:13:20.500Z");
  EXPECT_FALSE(json.contains("started_at"));
  EXPECT_FALSE(json.contains("failure"));
  EXPECT_EQ(json["results"][0]["size_bytes"], int64_t{1} << 40);
}

}  // namespace
}  // namespace sightline
