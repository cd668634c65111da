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

// A scan's information at the targets it informs about; one entry each.
struct ScanInformation {
  std::vector<uint32_t> targets;  // ascending
  std::vector<float> density;     // equivalent, [1/m^4]; > 0
};

// Posterior at a target, and the number of points behind it.
struct TargetUncertainty {
  SurfaceUncertainty uncertainty;
  int32_t points = 0;
  // Only if asked for: total uncertainty [m] after every scan.
  std::vector<float> after_each_scan_m;
};

// The information that a scan gives about the surface, by the fast estimate.
struct FastInformation {
  Feasibility feasibility = Feasibility::kFeasible;
  TargetBits covered;
  ScanInformation information;
};

// Required uncertainty of the targets, and the worth of reaching it (v1::UncertaintyGain).
struct UncertaintyRequirement {
  GainWeights weights;
  // One for all targets or one per target; 0: the target is not toleranced.
  std::span<const float> admissible_uncertainty_m;
  double relaxed_uncertainty_m = 0;
  // Equivalent density [1/m^4] accumulated from earlier scans; empty or one per target.
  std::span<const float> known_density;
  // The targets that earlier scans cover; may be null.
  const TargetBits* covered = nullptr;
  // Empty, or one per target: gains are weighted shares of the density needed instead.
  std::span<const float> target_weights;
};

struct UncertaintyGain {
  Feasibility feasibility = Feasibility::kFeasible;
  int32_t new_targets = 0;      // made admissible
  int32_t covered_targets = 0;  // measurable
  double gain = 0;              // with target weights: the weighted share
};

// A scan's points as inference needs them.
struct MeasuredScan {
  Feasibility feasibility = Feasibility::kFeasible;
  std::shared_ptr<const ScanPoints> points;  // null if not feasible
};

// Why a target is not covered (v1::UncoveredReason); in the order of the conditions that scans are
// asked about.
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
  // Index into CoverageScene::obstacles() if one is the reason; of collisions that which camera or
  // laser touch, -1: they touch the part or one another, or the part touches what stands still.
  int obstacle = -1;
  int tried_scans = 0;
  int scans_with_reason = 0;
  // kTooDark: shortest exposure that would show the line, least of the scans with the reason;
  // infinite: none would. kTooBright: longest, greatest of them. 0 with other reasons.
  double exposure_time_s = 0;
  Measurement scan;  // of targets that were not chosen: one that measures it
};

}  // namespace sightline
