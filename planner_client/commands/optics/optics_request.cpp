// SPDX-License-Identifier: Apache-2.0
#include "planner_client/commands/optics/optics_request.h"

#include <string>
#include <utility>

#include "core/json/strict_json.h"
#include "planner_client/commands/part_assets.h"

namespace sightline {

absl::StatusOr<OpticsRequest> MakeOpticsRequest(const FrameChoice& choice) {
  const std::string& input = choice.input;
  v1::Inspection message;
  if (absl::Status s = ReadStrictJsonFile(input, &message); !s.ok()) return s;
  auto checked = CheckImagingInspection(message, input);
  if (!checked.ok()) return checked.status();
  OpticsRequest made;
  made.inspection = std::move(checked->inspection);
  auto frames = ChooseFrames(choice, made.inspection, &made.remarks);
  if (!frames.ok()) return frames.status();
  for (v1::PartFrame& frame : *frames) {
    frame.clear_setting();  // it is what is looked for
    *made.request.add_frames() = std::move(frame);
  }
  v1::Inspection* sent = made.request.mutable_inspection();
  *sent = std::move(checked->message);
  const v1::CostModel costs = sent->costs();
  if (absl::Status s = TakeAssets(input, sent, &made.assets); !s.ok()) return s;
  *sent->mutable_costs() = costs;
  return made;
}

}  // namespace sightline
