// SPDX-License-Identifier: Apache-2.0
// A part on a rig with its targets: everything gain queries need.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/inspection/inspection.h"
#include "core/part/mesh.h"
#include "core/rig/measurement.h"
#include "core/rig/rig.h"
#include "core/surface_inference/surface_inference.h"
#include "core/targets/target_set.h"
#include "core/uncertainty/uncertainty_model.h"
#include "coverage_server/scan/measured_scans.h"

namespace sightline {

class ScanPoints;
struct TargetPriors;

enum class Feasibility { kFeasible, kCollision, kTravel, kOutOfBounds };

struct SceneObstacle {
  TriangleMesh mesh;
  ObstacleFrame frame;
};

struct SceneDefinition {
  TriangleMesh part;
  Rig rig;
  TargetSampling sampling;
  std::vector<SceneObstacle> obstacles;
  int field_directions = kDefaultFieldDirections;
  std::optional<UncertaintyModel> uncertainty;
  // The permitted scans; unset: camera and laser anywhere in free space.
  std::optional<MeasurementDomain> domain;
};

struct SceneBuildOptions {
  int threads = 0;  // 0: all cores
  std::function<void(double progress, const std::string& message)> on_progress;
  const std::atomic<bool>* cancelled = nullptr;
  MeasuredScans measured_scans;
};

struct SceneTimings {
  double targets_s = 0;
  double field_s = 0;
  double measurability_s = 0;
};

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
};

struct TargetExplanation {
  UncoveredReason reason = UncoveredReason::kNotChosen;
  // Index into CoverageScene::obstacles() if one is the reason; of collisions that which camera or
  // laser touch, -1: they touch the part or one another, or the part touches what stands still.
  int obstacle = -1;
  int tried_scans = 0;
  int scans_with_reason = 0;
  Measurement scan;  // of targets that were not chosen: one that measures it
};

// Immutable once built; all queries may run in parallel from any number of threads.
class CoverageScene {
 public:
  // INVALID_ARGUMENT, RESOURCE_EXHAUSTED as SampleTargets; CANCELLED.
  static absl::StatusOr<std::unique_ptr<CoverageScene>> Build(SceneDefinition definition,
                                                              const SceneBuildOptions& options);
  virtual ~CoverageScene() = default;

  virtual const TriangleMesh& part() const = 0;
  virtual const Rig& rig() const = 0;
  virtual const std::vector<SceneObstacle>& obstacles() const = 0;
  virtual const TargetSet& targets() const = 0;
  // The targets that are measurable in free space, within the limit on incidence and in the domain
  // (measurability/domain_measurability.h).
  virtual const TargetBits& measurable() const = 0;
  // Thesis section 6.1: some pair of unoccluded directions 10 to 80 degrees apart, whatever the
  // limits on the surface are.
  virtual const TargetBits& measurable_in_free_space() const { return measurable(); }
  // Bit r of a target: it is measurable with the part in resting orientation r of the domain. Empty:
  // the domain has none, or more than 64.
  virtual std::span<const uint64_t> measurable_orientations() const { return {}; }
  virtual Eigen::Vector3d part_centre_m() const = 0;
  virtual int64_t field_bytes() const = 0;
  virtual const SceneTimings& timings() const = 0;

  // Visibility-field estimates. `covered` may be null; `weights` empty or one per target.
  // Stops early (results unspecified) when *cancelled becomes true.
  virtual void EvaluateGains(std::span<const Measurement> measurements, const TargetBits* covered,
                             std::span<const float> weights, std::span<FastGain> gains,
                             const std::atomic<bool>* cancelled) const = 0;
  virtual void EvaluateFastCoverage(std::span<const Measurement> measurements,
                                    std::span<FastCoverage> coverages,
                                    const std::atomic<bool>* cancelled) const = 0;

  // Frame-by-frame definition. `points` may be null; otherwise receives all measured points in
  // order of frame, column, depth.
  virtual ExactCoverage EvaluateExact(const Measurement& measurement,
                                      std::vector<MeasurementPoint>* points,
                                      const std::atomic<bool>* cancelled) const = 0;

  // Explains which obstacles or limits keep the best scans of `domain` from measuring each of
  // `targets` (explanation/explain_targets.h). Stops early (results unspecified) when *cancelled.
  virtual void Explain(const MeasurementDomain& /*domain*/, std::span<const uint32_t> /*targets*/,
                       std::span<TargetExplanation> /*results*/,
                       const std::atomic<bool>* /*cancelled*/) const {}

  // How well scans make the surface known. Scenes that were built without an uncertainty model have
  // no priors and must not be asked.
  virtual const UncertaintyModel* uncertainty() const { return nullptr; }
  virtual const TargetPriors* priors() const { return nullptr; }
  virtual void EvaluateInformation(std::span<const Measurement> /*measurements*/,
                                   std::span<FastInformation> /*results*/,
                                   const std::atomic<bool>* /*cancelled*/) const {}
  virtual void EvaluateUncertaintyGains(std::span<const Measurement> /*measurements*/,
                                        const UncertaintyRequirement& /*requirement*/,
                                        std::span<UncertaintyGain> /*gains*/,
                                        const std::atomic<bool>* /*cancelled*/) const {}
  // Kept for a while, since plans are asked about again and again.
  virtual MeasuredScan MeasureForInference(const Measurement& /*measurement*/,
                                           const std::atomic<bool>* /*cancelled*/) const {
    return {};
  }
  // Posterior at targets after all of `scans`. `enough_m`: empty, or an uncertainty for every
  // target below which further scans are left out.
  virtual void Infer(std::span<const std::shared_ptr<const ScanPoints>> /*scans*/,
                     std::span<const uint32_t> /*targets*/, bool /*after_each_scan*/,
                     std::span<const float> /*enough_m*/, std::span<TargetUncertainty> /*results*/,
                     const std::atomic<bool>* /*cancelled*/) const {}
};

}  // namespace sightline
