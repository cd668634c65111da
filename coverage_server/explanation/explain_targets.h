// SPDX-License-Identifier: Apache-2.0
// Finds reasons why targets are not covered. The reason is a condition that is violated by the
// scans that come nearest to measuring the target.
//
// For every target, scans of the domain that aim at it are tried: first kSpreadScans that fill the
// domain evenly; then, if one of the best of them fails at one condition only, scans near the best
// ones. The conditions of a scan, in this order, are that the target
//   - faces camera and laser (angle; what faces away is hidden by its own part as well),
//   - is imaged finely enough (footprint) and sharply enough (defocus),
//   - lies in the image, the laser's fan and range (range),
//   - shows the laser line with a permitted exposure (too dark, too bright; asked only of targets
//     that face both sensors),
//   - is not hidden by the part or by an obstacle, from the camera and from the laser,
// and that camera and laser touch nothing then (collision). Every violated condition counts one,
// separately for the two sensors; range counts two, because neither sensor sees a target that is
// elsewhere when it is lit. (With a count of one, sheets that nearly contain the scan direction and
// light a place far beside the rig would win over scans with an obstacle in the way of both.) If a
// scan meets all conditions, it is checked as a whole: for collisions and for the travel of the
// stage. If such a scan can be carried out, the target was not chosen. Otherwise the reason is the
// condition that most of the scans with the fewest violations violate; ties go to the first in the
// order above, with light last.
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

// Enough for about three directions within a cone of 10 degrees half angle.
inline constexpr int kSpreadScans = 1024;
// Most scans per target that meet the conditions at the place and are then checked as a whole.
inline constexpr int kMostCarriedOut = 24;

// Result of the check of a whole scan, and the travel that was checked.
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
  // Every obstacle by itself, to identify the one that camera or laser touch.
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
