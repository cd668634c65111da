// SPDX-License-Identifier: Apache-2.0
// Client of a coverage server: queries one scene for gains, coverage, points and views.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "core/inspection/inspection.h"
#include "core/part/mesh.h"
#include "core/rig/rig.h"
#include "core/rig/scan_geometry.h"
#include "core/targets/target_set.h"
#include "core/targets/uncovered_reason.h"
#include "planner_client/rpc_client/channel.h"
#include "planning/strategy/gain_model.h"
#include "sightline/v1/coverage_service.pb.h"

namespace sightline {

// Everything coverage depends on, from which the server builds the scene.
struct CoverageTask {
  std::shared_ptr<const TriangleMesh> part;  // from LoadPart
  std::string part_name = "part";            // for messages
  Rig rig;
  TargetSampling sampling;
  struct Obstacle {
    std::shared_ptr<const TriangleMesh> mesh;
    ObstacleFrame frame;
    std::string name = "obstacle";
  };
  std::vector<Obstacle> obstacles;
  int field_directions = kDefaultFieldDirections;
  std::optional<UncertaintyModel> uncertainty;  // unset: coverage only
  // The permitted scans; they determine which targets count as measurable. If unset, camera and
  // laser may be anywhere in free space, and the scene explains no targets.
  std::optional<MeasurementDomain> domain;
  // Contains the table and both exposure times. If unset, light limits no targets.
  std::optional<v1::Detectability> detectability;
};

// An embedded server that ends is restarted as often as its options allow.
struct CoverageClientOptions : ServerAccess {
  // Number of measurements per request of fast queries, [1, 4096], and of concurrent requests.
  // Results do not depend on them.
  int min_batch = 64;
  int max_batch = 256;
  int outstanding_requests = 3;
  // Retries after UNAVAILABLE only, with growing pauses, for at most this time.
  absl::Duration retry_for = absl::Seconds(10);
  // Build progress in [0, 1]. Called only within Open and on its thread, not when a later query
  // rebuilds a scene that the server has lost.
  std::function<void(double progress, const std::string& message)> on_progress;
  // Ends the build (CANCELLED) when it becomes true. May be null.
  const std::atomic<bool>* interrupted = nullptr;
};

struct SceneInfo {
  std::string part_digest;
  std::string scene_digest;
  v1::SceneSpec spec;        // normalised by the server
  std::string server_build;  // SHA-256 of the server's program; empty: it does not say
  int64_t target_count = 0;
  int64_t measurable_count = 0;
  int64_t measurable_in_free_space_count = 0;
  Eigen::Vector3d part_centre_m;
  Eigen::Vector3d part_size_m;
  int64_t field_bytes = 0;
  double targets_time_s = 0;
  double field_time_s = 0;
  double measurability_time_s = 0;
};

struct ScanPoint {
  Eigen::Vector3f position_m;  // part coordinates
  Eigen::Vector3f normal;
  int32_t frame;  // stage position / scan step
  int32_t column_px;
};

// Required uncertainty of the targets (v1::UncertaintyGain).
struct UncertaintyQuery {
  GainWeights weights;
  std::vector<float> admissible_uncertainty_m;  // one per target; 0: not toleranced
  double relaxed_uncertainty_m = 0;
  TargetBits covered;  // by earlier scans; empty: none
};

// Information of a scan about the surface: equivalent information density [1/m^4], fast estimate.
struct InformedScan {
  ScanFeasibility feasibility = ScanFeasibility::kFeasible;
  TargetBits covered;  // measurable targets
  std::vector<uint32_t> targets;
  std::vector<float> density;
};

// Exact standard uncertainties [m] of targets after scans.
struct PosteriorUncertainties {
  std::vector<float> total_m, noise_m, sampling_m, calibration_m;
  std::vector<float> registration_m;  // of registered set-ups; empty: none
  std::vector<int32_t> points;
  std::vector<float> after_each_scan_m;  // [target][scan]; empty if not asked for
};

// Calls wait as long as the server shows signs of life (rpc_client/channel.h). If a restarted
// server has lost the scene, the client uploads it again, transparently for the caller.
// Thread-safe. Errors of the server are passed on with its message; UNAVAILABLE states when and why
// an embedded server died.
class CoverageClient : public GainModel {
 public:
  // Uploads missing parts, has the scene built and fetches its targets.
  static absl::StatusOr<std::unique_ptr<CoverageClient>> Open(CoverageClientOptions options,
                                                              CoverageTask task);

  virtual const SceneInfo& scene() const = 0;
  // TargetSet::triangles stays empty.
  virtual const TargetSet& targets() const = 0;
  // Bit r of a target: it is measurable with the part in resting orientation r of the task's
  // domain. Empty if the domain has no orientations or more than 64, or if the server gives none.
  virtual std::span<const uint64_t> measurable_orientations() const { return {}; }
  // Exact, with part, camera and laser of every scan displaced; one displacement per measurement.
  virtual absl::StatusOr<std::vector<ScanCoverage>> DisplacedCoverage(
      std::span<const Measurement> measurements,
      std::span<const ScanDisplacement> displacements) = 0;
  // All measured points of one scan, exact. FAILED_PRECONDITION: the scan is not feasible.
  virtual absl::StatusOr<std::vector<ScanPoint>> MeasurementPoints(
      const Measurement& measurement) = 0;
  // Only for tasks with an uncertainty model. `known_density` [1/m^4]: one per target; weights:
  // empty, or one per target (weighted shares in ScanGain::weighted_gain).
  virtual absl::StatusOr<std::vector<ScanGain>> UncertaintyGains(
      std::span<const Measurement> measurements, const UncertaintyQuery& query,
      std::span<const float> known_density, std::span<const float> weights) = 0;
  virtual absl::StatusOr<std::vector<InformedScan>> FastInformation(
      std::span<const Measurement> measurements) = 0;
  // `targets`: empty for all. FAILED_PRECONDITION: a scan is not feasible.
  virtual absl::StatusOr<PosteriorUncertainties> Uncertainties(std::span<const Measurement> scans,
                                                               std::span<const uint32_t> targets,
                                                               bool after_each_scan,
                                                               std::span<const float> enough_m) = 0;
  // One reason per target that is not covered; obstacles by index in the task. FAILED_PRECONDITION:
  // the task has no domain.
  virtual absl::StatusOr<std::vector<TargetReason>> ExplainTargets(
      std::span<const uint32_t> targets) = 0;
  // PNG bytes. `request.scene_digest` is filled in.
  virtual absl::StatusOr<std::string> RenderView(v1::RenderViewRequest request) = 0;
  // Number of times that the scene was rebuilt after the server had lost it.
  virtual int recoveries() const = 0;
};

}  // namespace sightline
