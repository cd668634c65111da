// SPDX-License-Identifier: Apache-2.0
// What a render worker is asked when a setting of camera and laser is looked for.
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
  std::vector<std::string> remarks;  // what to know of the plan
};

// Of the frames that are chosen. INVALID_ARGUMENT: the inspection lacks what images need
// (CheckImagingInspection), or what ChooseFrames says.
absl::StatusOr<OpticsRequest> MakeOpticsRequest(const FrameChoice& choice);

}  // namespace sightline
