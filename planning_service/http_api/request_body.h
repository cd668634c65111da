// SPDX-License-Identifier: Apache-2.0
// Bodies of requests that describe a job or a recipe.
//
// JSON bodies of all requests share a limit on memory. `memory` is the client's share: it grows
// with the text that arrives and, before parsing, by the most that the message may take
// (MostMessageBytes). The caller keeps it as long as the message. UNAVAILABLE, reason OVERLOADED,
// with a retry delay: there is not enough memory at the moment.
#pragma once

#include <google/protobuf/message.h>

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/admission/shared_limit.h"
#include "planning_service/http/http_exchange.h"
#include "planning_service/jobs/planning_jobs.h"
#include "sightline/v1/planning_task.pb.h"

namespace sightline {

// A task with its files as received; only the names have been checked.
struct TaskForm {
  v1::PlanningTask task;
  std::vector<JobFile> files;
  bool has_priority = false;
  int priority = 0;
};

bool IsMultipartForm(const HttpRequest& request);

// Reads multipart/form-data: `task`, `priority` and files, which are written to disk as they
// arrive. INVALID_ARGUMENT names the part. Also errors of HttpExchange::ReadBody and FileUpload.
absl::StatusOr<TaskForm> ReadTaskForm(HttpExchange& exchange, PlanningJobs* jobs,
                                      const Client& client, SharedLimit::Share* memory);

// Reads the whole body into `message`. INVALID_ARGUMENT with the field; reason
// MEDIA_TYPE_NOT_SUPPORTED if it is not application/json. `may_be_empty`: an empty body is allowed
// and leaves the message unchanged.
absl::Status ReadJsonBody(HttpExchange& exchange, bool may_be_empty, SharedLimit::Share* memory,
                          google::protobuf::Message* message);

// Reads the body as one file. INVALID_ARGUMENT, reason DIGEST_MISMATCH: `expected_digest` is not
// empty and differs from its digest.
absl::StatusOr<JobFile> ReadFileBody(HttpExchange& exchange, PlanningJobs* jobs,
                                     const Client& client, const std::string& expected_digest);

// Reads an integer of a field or query.
absl::StatusOr<int64_t> ReadInteger(const std::string& field, const std::string& text, int64_t min,
                                    int64_t max);

}  // namespace sightline
