// SPDX-License-Identifier: Apache-2.0
// Answers of a scene to gain, coverage, uncertainty and explanation queries (CoverageScene).
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "core/inspection/inspection.h"
#include "core/rig/measurement.h"
#include "core/surface_inference/surface_inference.h"
#include "core/targets/target_set.h"

namespace sightline {

class ScanPoints;

enum class Feasibility { kFeasible, kCollision, kTravel, kOutOfBounds };

struct FastGain {
  Feasibility feasibility = Feasibility::kFeasible;
  int32_t new_targets = 0;      // measurable, not covered before
  int32_t covered_targets = 0;  // measurable
  double weighted_gain = 0;     // sum of weights of new targets
};

struct FastCoverage {
  Feasibility feasibility = Feasibility::kFeasible;
  TargetBits covered;
};

struct ExactCoverage {
  Feasibility feasibility = Feasibility::kFeasible;
  TargetBits covered;
  TargetBits covered_without_normal_gate;
  int32_t first_frame = 0;
  int32_t last_frame = -1;
  int64_t measurement_points = 0;
};

// Information of a scan about targets; one entry per informed target.
struct ScanInformation {
  std::vector<uint32_t> targets;  // ascending
  std::vector<float> density;     // equivalent, [1/m^4]; > 0
};

// Posterior at a target, and the number of points behind it.
struct TargetUncertainty {
  SurfaceUncertainty uncertainty;
  int32_t points = 0;
  // Total uncertainty [m] after every scan; filled only on request.
  std::vector<float> after_each_scan_m;
};

// The information that a scan gives about the surface, by the fast estimate.
struct FastInformation {
  Feasibility feasibility = Feasibility::kFeasible;
  TargetBits covered;
  ScanInformation information;
};

// Required uncertainty of the targets, and the gain for reaching it (v1::UncertaintyGain).
struct UncertaintyRequirement {
  GainWeights weights;
  // One for all targets or one per target; 0: the target is not toleranced.
  std::span<const float> admissible_uncertainty_m;
  double relaxed_uncertainty_m = 0;
  // Equivalent density [1/m^4] accumulated from earlier scans; empty or one per target.
  std::span<const float> known_density;
  // The targets that earlier scans cover; may be null.
  const TargetBits* covered = nullptr;
  // Empty, or one weight per target: the gain is then the weighted sum of fractions of the required
  // density.
  std::span<const float> target_weights;
};

struct UncertaintyGain {
  Feasibility feasibility = Feasibility::kFeasible;
  int32_t new_targets = 0;      // made admissible
  int32_t covered_targets = 0;  // measurable
  double gain = 0;              // with target weights: the weighted share
};

// The points of a scan in the form that inference needs.
struct MeasuredScan {
  Feasibility feasibility = Feasibility::kFeasible;
  std::shared_ptr<const ScanPoints> points;  // null if not feasible
};

// Reason why a target is not covered (v1::UncoveredReason), in the order in which the conditions
// of a scan are checked.
enum class UncoveredReason {
  kNotChosen,
  kAngle,
  kFootprint,
  kDefocus,
  kRange,
  kOwnOcclusion,
  kObstacle,
  kCollision,
  kTravel,
  kTooDark,
  kTooBright,
};

struct TargetExplanation {
  UncoveredReason reason = UncoveredReason::kNotChosen;
  // Index into CoverageScene::obstacles() if an obstacle is the reason. With a collision, the
  // obstacle that camera or laser touch; -1: another collision (with the part, between camera and
  // laser, or of the part with an obstacle that stands still).
  int obstacle = -1;
  int tried_scans = 0;
  int scans_with_reason = 0;
  // kTooDark: shortest exposure that would show the line, minimum over the scans with this reason;
  // infinite: no exposure would. kTooBright: longest such exposure, maximum over them. Else 0.
  double exposure_time_s = 0;
  Measurement scan;  // for targets that were not chosen: a scan that measures the target
};

}  // namespace sightline
