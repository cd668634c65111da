// SPDX-License-Identifier: Apache-2.0
// Exposure times that camera, frame rate and stage permit.
#pragma once

#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "core/inspection/inspection.h"

namespace sightline {

// Speed of the stage, and the exposure times that it allows.
struct ExposureLimit {
  // Highest speed that stage and frame rate allow [m/s]; 0: not known.
  double stage_speed_m_per_s = 0;
  // Longest total exposure of a frame [s]; unset: no limit.
  std::optional<double> longest_s;
  std::string because;  // frame time or motion blur
};

// `image_speed_px_per_m`: motion of the image per travel of the stage. If time has a cost, the
// stage may go slower, so that the exposure is not limited.
ExposureLimit LimitExposure(const CostModel& costs, double scan_step_m,
                            const OpticsPlanning& planning, double image_speed_px_per_m);

// Permitted exposure times of a frame, and the reason of the upper limit.
struct PermittedExposures {
  double shortest_s = 0, longest_s = 0;
  std::string longest_because;  // "the camera", frame time or motion blur
};

// The times that detectability states, else those of the camera (by default kShortestExposure_s to
// kLongestExposure_s); the longest is also limited by LimitExposure. The image's motion is that at
// the domain's nearest camera distance, across the line of sight. INVALID_ARGUMENT names `context`:
// the shortest time is longer than the longest, or a stated time is outside the range of the
// camera.
absl::StatusOr<PermittedExposures> PermittedExposuresOf(const Inspection& inspection,
                                                        const std::string& context);

}  // namespace sightline
