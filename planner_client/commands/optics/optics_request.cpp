// SPDX-License-Identifier: Apache-2.0
#include "planner_client/commands/optics/optics_request.h"

#include <string>
#include <utility>

#include "core/json/strict_json.h"
#include "core/status/status_macros.h"
#include "planner_client/commands/part_assets.h"

namespace sightline {

absl::StatusOr<OpticsRequest> MakeOpticsRequest(const FrameChoice& choice) {
  const std::string& input = choice.input;
  v1::Inspection message;
  SIGHTLINE_RETURN_IF_ERROR(ReadStrictJsonFile(input, &message));
  SIGHTLINE_ASSIGN_OR_RETURN(auto checked, CheckImagingInspection(message, input));
  OpticsRequest made;
  made.inspection = std::move(checked.inspection);
  SIGHTLINE_ASSIGN_OR_RETURN(auto frames, ChooseFrames(choice, made.inspection, &made.remarks));
  for (v1::PartFrame& frame : frames) {
    frame.clear_setting();  // it is what is looked for
    *made.request.add_frames() = std::move(frame);
  }
  v1::Inspection* sent = made.request.mutable_inspection();
  *sent = std::move(checked.message);
  const v1::CostModel costs = sent->costs();
  SIGHTLINE_RETURN_IF_ERROR(TakeAssets(input, sent, &made.assets));
  *sent->mutable_costs() = costs;
  return made;
}

}  // namespace sightline
