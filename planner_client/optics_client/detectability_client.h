// SPDX-License-Identifier: Apache-2.0
// Asks a render worker for the exposure times that show the laser line on materials, and keeps the
// answers.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "planner_client/rpc_client/worker_call.h"
#include "sightline/v1/optics_service.pb.h"

namespace sightline {

// A question about detectability, of the fields of an inspection that it depends on.
struct DetectabilityQuestion {
  v1::CreateDetectabilityRequest request;  // without id and assets
  std::vector<AssetFile> assets;
};

// Runs the job. Errors of the job; INTERNAL, with a word on why, if the worker ended.
absl::StatusOr<v1::DetectabilityTable> AskDetectability(const WorkerClientOptions& options,
                                                        const DetectabilityQuestion& question);

// The kept answer to the question by the worker of that build, or else the one that `ask` gives,
// which is kept from then on: as a file in `folder`, which exists, named by the SHA-256 of question
// and build. Answers that nobody asked for in 30 days go. A damaged file is asked for again.
absl::StatusOr<v1::DetectabilityTable> KeptDetectability(
    const std::string& folder, const std::string& worker_build,
    const DetectabilityQuestion& question,
    const std::function<absl::StatusOr<v1::DetectabilityTable>()>& ask);

}  // namespace sightline
