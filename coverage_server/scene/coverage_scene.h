// SPDX-License-Identifier: Apache-2.0
// A part on a rig with its targets: all data for gain queries.
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
#include "core/rig/scan_geometry.h"
#include "core/targets/target_set.h"
#include "core/uncertainty/uncertainty_model.h"
#include "coverage_server/answers/scene_answers.h"
#include "coverage_server/scan/measured_scans.h"

namespace sightline {

struct TargetPriors;

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
  // The permitted scans; unset: camera and laser may be anywhere in free space.
  std::optional<MeasurementDomain> domain;
  // With tables and both exposure times. Unset: light limits nothing.
  std::optional<Detectability> detectability;
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

// Immutable once built; all queries may run in parallel from any number of threads.
class CoverageScene {
 public:
  // Errors INVALID_ARGUMENT and RESOURCE_EXHAUSTED as for SampleTargets; CANCELLED.
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
  // The targets with a pair of unoccluded directions 10 to 80 degrees apart (thesis section 6.1),
  // regardless of limits on incidence.
  virtual const TargetBits& measurable_in_free_space() const { return measurable(); }
  // Bit r of a target's entry: the target is measurable with the part in resting orientation r of
  // the domain. Empty: the domain has no or more than 64 resting orientations.
  virtual std::span<const uint64_t> measurable_orientations() const { return {}; }
  virtual Eigen::Vector3d part_centre_m() const = 0;
  virtual int64_t field_bytes() const = 0;
  virtual const SceneTimings& timings() const = 0;

  // Estimates gains by the visibility field. `covered` may be null; `weights`: empty or one per
  // target. Stops early (results unspecified) when *cancelled becomes true.
  virtual void EvaluateGains(std::span<const Measurement> measurements, const TargetBits* covered,
                             std::span<const float> weights, std::span<FastGain> gains,
                             const std::atomic<bool>* cancelled) const = 0;
  virtual void EvaluateFastCoverage(std::span<const Measurement> measurements,
                                    std::span<FastCoverage> coverages,
                                    const std::atomic<bool>* cancelled) const = 0;

  // Evaluates coverage by its definition, frame by frame. `points` may be null; otherwise it
  // receives all measured points in order of frame, column, depth.
  virtual ExactCoverage EvaluateExact(const Measurement& measurement,
                                      std::vector<MeasurementPoint>* points,
                                      const std::atomic<bool>* cancelled) const = 0;

  // The same with part, camera and laser displaced. The rig's clearance does not apply, and the
  // scan may use more travel than the stage has: a plan states its travel for parts without
  // displacement.
  virtual ExactCoverage EvaluateDisplaced(const Measurement& measurement,
                                          const ScanDisplacement& displacement,
                                          const std::atomic<bool>* cancelled) const = 0;

  // Explains which obstacles or limits keep the best scans of `domain` from measuring each of
  // `targets` (explanation/explain_targets.h). Stops early (results unspecified) when *cancelled.
  virtual void Explain(const MeasurementDomain& /*domain*/, std::span<const uint32_t> /*targets*/,
                       std::span<TargetExplanation> /*results*/,
                       const std::atomic<bool>* /*cancelled*/) const {}

  // Queries about the uncertainty of the surface after scans. Scenes without an uncertainty model
  // have no priors and must not get these queries.
  virtual const UncertaintyModel* uncertainty() const { return nullptr; }
  virtual const TargetPriors* priors() const { return nullptr; }
  virtual void EvaluateInformation(std::span<const Measurement> /*measurements*/,
                                   std::span<FastInformation> /*results*/,
                                   const std::atomic<bool>* /*cancelled*/) const {}
  virtual void EvaluateUncertaintyGains(std::span<const Measurement> /*measurements*/,
                                        const UncertaintyRequirement& /*requirement*/,
                                        std::span<UncertaintyGain> /*gains*/,
                                        const std::atomic<bool>* /*cancelled*/) const {}
  // Results are cached, because the scans of a plan are queried repeatedly.
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
