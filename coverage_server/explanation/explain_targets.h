// SPDX-License-Identifier: Apache-2.0
// Reasons why targets are not covered: the conditions at which the scans fail that come nearest to
// measuring them.
//
// For every target scans of the domain are tried that aim at it: first kSpreadScans that fill the
// domain evenly, then, if the best of them fails at one condition only, some near the best ones. A
// scan is asked, in this order, whether the target
//   - faces camera and laser (angle; what faces away is hidden by its own part as well),
//   - is imaged finely enough (footprint) and sharply enough (defocus),
//   - lies in the image, the laser's fan and range (range),
//   - shows the laser line with a permitted exposure (too dark, too bright; asked only of targets
//     that face both sensors),
//   - is hidden by the part or by an obstacle, from the camera and from the laser,
// and whether camera or laser touch anything then (collision). Each counts, the two sensors
// separately, and range twice: neither sensor sees a target that is elsewhere when it is lit. (Were
// it to count once, sheets that nearly hold the scan direction and light a place far beside the rig
// would come before those that find an obstacle in the way of both.) A scan that passes all of it
// is asked whether it can be carried out as a whole: without a collision, and without more travel
// than there is. If one can, the target was not chosen. If none can, the reason is the condition
// that most of the scans with the fewest failed conditions fail at, at equal numbers the first in
// the order above, with light last.
#pragma once

#include <Eigen/Core>
#include <atomic>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "core/inspection/inspection.h"
#include "core/rig/rig.h"
#include "core/targets/target_set.h"
#include "coverage_server/answers/scene_answers.h"
#include "coverage_server/collision/collision.h"
#include "coverage_server/detectability/light_limit.h"

namespace sightline {

// Enough to look about three times into a cone of 10 degrees half angle.
inline constexpr int kSpreadScans = 1024;
// Scans that pass at the place and are asked whether they can be carried out.
inline constexpr int kMostCarriedOut = 24;

// Whether a whole scan can be carried out, and the travel that this was asked of.
struct CarriedOut {
  Feasibility feasibility = Feasibility::kFeasible;
  double stage_start_m = 0, stage_end_m = 0;
};

struct ExplanationTask {
  const Rig* rig = nullptr;
  const MeasurementDomain* domain = nullptr;
  const TargetSet* targets = nullptr;
  const TargetSampling* sampling = nullptr;
  // The part first, then the obstacles (at most 64).
  const std::vector<Occluder>* occluders = nullptr;
  // Every obstacle by itself, to find out which one camera or laser touch.
  const std::vector<std::vector<Occluder>>* single_obstacles = nullptr;
  Eigen::Vector3d part_centre_m = Eigen::Vector3d::Zero();
  const LightLimit* light = nullptr;  // null: light limits nothing
  // Carries out a scan that lights the target at `stage_m`.
  std::function<CarriedOut(const Measurement&, double stage_m)> carry_out;
};

// One result for each of `targets` (indices into the task's). The same for any split of the targets
// among calls. Stops early (results unspecified) when *cancelled, which may be null.
void ExplainTargets(const ExplanationTask& task, std::span<const uint32_t> targets,
                    std::span<TargetExplanation> results, const std::atomic<bool>* cancelled);

}  // namespace sightline
