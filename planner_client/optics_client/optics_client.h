// SPDX-License-Identifier: Apache-2.0
// Asks a render worker for the best setting of camera and laser.
#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "planner_client/rpc_client/worker_call.h"
#include "sightline/v1/optics_service.pb.h"

namespace sightline {

// `request` without its id and assets, which are set here. Errors of the job; INTERNAL, with the
// cause, if the worker ended.
absl::StatusOr<v1::OpticsPlan> PlanOptics(const WorkerClientOptions& options,
                                          v1::CreateOpticsRequest request,
                                          const std::vector<AssetFile>& assets);

}  // namespace sightline
