// SPDX-License-Identifier: Apache-2.0
// Asks a render worker for the exposure times at which the laser line is visible on materials, and
// caches the answers.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "planner_client/rpc_client/worker_call.h"
#include "sightline/v1/optics_service.pb.h"

namespace sightline {

// A question about detectability, made from the fields of an inspection that it depends on.
struct DetectabilityQuestion {
  v1::CreateDetectabilityRequest request;  // without id and assets
  std::vector<AssetFile> assets;
};

// Runs the job. Errors of the job; INTERNAL, with the cause, if the worker ended.
absl::StatusOr<v1::DetectabilityTable> AskDetectability(const WorkerClientOptions& options,
                                                        const DetectabilityQuestion& question);

// Returns the cached answer to the question by this build of the worker, or calls `ask` and stores
// the result as a file in `folder`, which must exist. The file name is the SHA-256 of question and
// build. Answers unused for 30 days are removed. A damaged file is replaced.
absl::StatusOr<v1::DetectabilityTable> KeptDetectability(
    const std::string& folder, const std::string& worker_build,
    const DetectabilityQuestion& question,
    const std::function<absl::StatusOr<v1::DetectabilityTable>()>& ask);

}  // namespace sightline
