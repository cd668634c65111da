// SPDX-License-Identifier: Apache-2.0
// Bodies of requests that describe a job or a recipe.
//
// JSON bodies of all requests share memory: `memory` is the client's share, which grows by the text
// as it comes and by the most that its message may take (MostMessageBytes) before it is parsed. The
// caller keeps it for as long as it has the message. UNAVAILABLE, reason OVERLOADED, with a retry
// delay: there is not enough at the moment.
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

// A task with its files, as they came; nothing is checked yet but names.
struct TaskForm {
  v1::PlanningTask task;
  std::vector<JobFile> files;
  bool has_priority = false;
  int priority = 0;
};

bool IsMultipartForm(const HttpRequest& request);

// Takes in multipart/form-data: `task`, `priority`, and files, which go to disk as they come.
// INVALID_ARGUMENT names the part; else errors of HttpExchange::ReadBody and FileUpload.
absl::StatusOr<TaskForm> ReadTaskForm(HttpExchange& exchange, PlanningJobs* jobs,
                                      const Client& client, SharedLimit::Share* memory);

// Reads the whole body into `message`. INVALID_ARGUMENT with the field; reason
// MEDIA_TYPE_NOT_SUPPORTED if it is not application/json. `may_be_empty`: no body leaves the
// message as it is.
absl::Status ReadJsonBody(HttpExchange& exchange, bool may_be_empty, SharedLimit::Share* memory,
                          google::protobuf::Message* message);

// Takes in the body as one file. INVALID_ARGUMENT, reason DIGEST_MISMATCH, if `expected_digest` is
// given and another.
absl::StatusOr<JobFile> ReadFileBody(HttpExchange& exchange, PlanningJobs* jobs,
                                     const Client& client, const std::string& expected_digest);

// Reads an integer of a field or query.
absl::StatusOr<int64_t> ReadInteger(const std::string& field, const std::string& text, int64_t min,
                                    int64_t max);

}  // namespace sightline
