// SPDX-License-Identifier: Apache-2.0
// Request to a render worker for the choice of a setting of camera and laser.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/inspection/inspection.h"
#include "planner_client/commands/frame_choice.h"
#include "planner_client/rpc_client/worker_call.h"
#include "sightline/v1/optics_service.pb.h"

namespace sightline {

struct OpticsRequest {
  Inspection inspection;
  v1::CreateOpticsRequest request;  // without id and assets
  std::vector<AssetFile> assets;
  std::vector<std::string> remarks;  // remarks on the plan
};

// Makes a request for the chosen frames. INVALID_ARGUMENT: the inspection lacks inputs of images
// (CheckImagingInspection), or errors of ChooseFrames.
absl::StatusOr<OpticsRequest> MakeOpticsRequest(const FrameChoice& choice);

}  // namespace sightline
