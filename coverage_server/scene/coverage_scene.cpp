// SPDX-License-Identifier: Apache-2.0
#include "coverage_server/scene/coverage_scene.h"

#include <algorithm>
#include <chrono>
#include <mutex>
#include <numbers>
#include <thread>

#include "absl/strings/str_format.h"
#include "core/memo/lru_store.h"
#include "core/parallel/worker_threads.h"
#include "core/status/status_macros.h"
#include "core/targets/poisson_disk.h"
#include "core/targets/target_regions.h"
#include "coverage_server/collision/collision.h"
#include "coverage_server/detectability/light_limit.h"
#include "coverage_server/detectability/light_map.h"
#include "coverage_server/explanation/explain_targets.h"
#include "coverage_server/measurability/domain_measurability.h"
#include "coverage_server/measurability/measurability.h"
#include "coverage_server/scan/exact_evaluator.h"
#include "coverage_server/scan/fast_evaluator.h"
#include "coverage_server/scan/target_lookup.h"
#include "coverage_server/scene/hull_corners.h"
#include "coverage_server/uncertainty/exact_inference.h"
#include "coverage_server/uncertainty/information_estimator.h"
#include "coverage_server/uncertainty/target_priors.h"
#include "coverage_server/uncertainty/uncertainty_gain.h"
#include "coverage_server/visibility/surface_probes.h"
#include "coverage_server/visibility/visibility_field.h"

namespace sightline {
namespace {

// Range of the triangulation angle (Table 2.1).
constexpr double kMinTriangulationRad = 10 * std::numbers::pi / 180;
constexpr double kMaxTriangulationRad = 80 * std::numbers::pi / 180;

// Memory for inferred scans; the least recently used are dropped first.
constexpr int64_t kInferredScansBytes = int64_t{400} << 20;

double SecondsSince(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

// A region of interest without a target would count as fully covered.
absl::Status CheckRegionsHoldTargets(const TargetSet& targets, const TargetSampling& sampling,
                                     const std::atomic<bool>* cancelled) {
  for (size_t r = 0; r < sampling.regions.size(); ++r) {
    if (cancelled != nullptr && cancelled->load()) return absl::CancelledError("scene");
    const TargetRegion& region = sampling.regions[r];
    bool holds = false;
    for (size_t t = 0; t < targets.size() && !holds; ++t) holds = LiesInRegion(targets, t, region);
    if (holds) continue;
    return absl::InvalidArgumentError(
        absl::StrFormat("targets.regions[%d] (\"%s\") holds no target: its box does not meet the "
                        "part's surface, or "
                        "is too small for its spacing_m of %.6g",
                        r, region.name, region.spacing_m));
  }
  return absl::OkStatus();
}

class CoverageSceneImpl final : public CoverageScene {
 public:
  explicit CoverageSceneImpl(SceneDefinition definition)
      : definition_(std::move(definition)),
        part_centre_m_(definition_.rig.part_placement ? definition_.rig.part_placement->centre_m
                                                      : definition_.part.BoundingBox().center()),
        domain_(ThesisDomain()) {}

  absl::Status Init(const SceneBuildOptions& options) {
    measured_scans_ = options.measured_scans;
    const auto report = [&](double progress, const std::string& message) {
      if (options.on_progress) options.on_progress(progress, message);
    };
    auto start = std::chrono::steady_clock::now();
    report(0, "sampling targets");
    SIGHTLINE_ASSIGN_OR_RETURN(
        targets_, SampleTargets(definition_.part, definition_.sampling, options.cancelled));
    SIGHTLINE_RETURN_IF_ERROR(
        CheckRegionsHoldTargets(targets_, definition_.sampling, options.cancelled));
    timings_.targets_s = SecondsSince(start);
    const auto cancelled = [&] {
      return options.cancelled != nullptr && options.cancelled->load();
    };
    if (cancelled()) return absl::CancelledError("scene");

    start = std::chrono::steady_clock::now();
    report(0.05, "rendering the visibility field");
    occluders_.push_back({ObstacleFrame::kPart, TriangleBvh(definition_.part, options.cancelled)});
    std::vector<const TriangleMesh*> fixtures;
    for (const SceneObstacle& obstacle : definition_.obstacles) {
      if (cancelled()) return absl::CancelledError("scene");
      occluders_.push_back({obstacle.frame, TriangleBvh(obstacle.mesh, options.cancelled)});
      if (obstacle.frame == ObstacleFrame::kPart) fixtures.push_back(&obstacle.mesh);
    }
    if (cancelled()) return absl::CancelledError("scene");
    SIGHTLINE_RETURN_IF_ERROR(FindTable(options.cancelled));
    TargetSampling probed = definition_.sampling;
    if (definition_.uncertainty) {
      priors_ = MakeTargetPriors(targets_, definition_.sampling, *definition_.uncertainty);
      // Points beyond the length scale say little about a target: probes stand there.
      probed.coverage_radius_m = std::min(
          probed.coverage_radius_m, priors_->smallest_length_scale_m() / kProbeRadiusRelative);
    }
    const SurfaceProbes probes =
        MakeSurfaceProbes(definition_.part, occluders_[0].bvh, targets_, probed, options.cancelled);
    if (cancelled()) return absl::CancelledError("scene");
    FieldBuildOptions field_options;
    field_options.directions = definition_.field_directions;
    field_options.processes = options.threads;
    field_options.cancelled = options.cancelled;
    field_options.on_progress = [&](double p) {
      report(0.05 + 0.9 * p, "rendering the visibility field");
    };
    SIGHTLINE_ASSIGN_OR_RETURN(
        field_, BuildVisibilityField(definition_.part, fixtures, targets_, probes, field_options));
    FastEvaluator::TargetLight light;
    if (definition_.detectability) {
      light_ = std::make_unique<LightLimit>(*definition_.detectability, definition_.part);
      light_map_ = std::make_unique<LightMap>(*light_);
      light.map = light_map_.get();
      for (const uint32_t triangle : targets_.triangles) {
        light.entries.push_back(light_->EntryOf(triangle));
      }
    }
    fast_ = std::make_unique<FastEvaluator>(targets_, definition_.sampling, probes, *field_,
                                            std::move(light));
    lookup_ = std::make_unique<TargetLookup>(targets_, definition_.sampling);
    if (priors_) {
      report(0.9, "measuring surfaces around targets");
      std::vector<ExtentCost> costs(targets_.size());
      ForTargetShares(options.threads, [&](size_t begin, size_t end) {
        ComputeExtentCosts(definition_.part, occluders_[0].bvh, targets_, *priors_,
                           definition_.sampling.max_normal_angle_rad, begin, end, costs,
                           options.cancelled);
      });
      estimator_ = std::make_unique<InformationEstimator>(
          targets_, probes, *priors_, *definition_.uncertainty, std::move(costs));
    }
    timings_.field_s = SecondsSince(start);
    if (cancelled()) return absl::CancelledError("scene");

    start = std::chrono::steady_clock::now();
    report(0.95, "deciding measurability");
    measurable_ = TargetBits(targets_.size());
    MarkMeasurableTargets(options);
    if (cancelled()) return absl::CancelledError("scene");
    timings_.measurability_s = SecondsSince(start);
    report(1, "ready");
    return absl::OkStatus();
  }

  const TriangleMesh& part() const override { return definition_.part; }
  const Rig& rig() const override { return definition_.rig; }
  const std::vector<SceneObstacle>& obstacles() const override { return definition_.obstacles; }
  const TargetSet& targets() const override { return targets_; }
  const TargetBits& measurable() const override { return measurable_; }
  const TargetBits& measurable_in_free_space() const override { return measurable_in_free_space_; }
  std::span<const uint64_t> measurable_orientations() const override {
    return measurable_orientations_;
  }
  Eigen::Vector3d part_centre_m() const override { return part_centre_m_; }
  int64_t field_bytes() const override {
    return static_cast<int64_t>(field_->bytes()) + (light_map_ ? light_map_->bytes() : 0);
  }
  const SceneTimings& timings() const override { return timings_; }

  void EvaluateGains(std::span<const Measurement> measurements, const TargetBits* covered,
                     std::span<const float> weights, std::span<FastGain> gains,
                     const std::atomic<bool>* cancelled) const override {
    std::vector<FastCoverage> coverages(measurements.size());
    EvaluateFastCoverage(measurements, coverages, cancelled);
    // An evaluation that was cancelled has no targets.
    if (cancelled != nullptr && cancelled->load()) return;
    for (size_t i = 0; i < measurements.size(); ++i) {
      FastGain& gain = gains[i];
      gain = {.feasibility = coverages[i].feasibility};
      if (gain.feasibility != Feasibility::kFeasible) continue;
      TargetBits& bits = coverages[i].covered;
      bits &= measurable_;
      gain.covered_targets = static_cast<int32_t>(bits.Count());
      if (covered != nullptr) bits.Subtract(*covered);
      gain.new_targets = static_cast<int32_t>(bits.Count());
      if (weights.empty()) continue;
      for (size_t w = 0; w < bits.words().size(); ++w) {
        for (uint64_t word = bits.words()[w]; word != 0; word &= word - 1) {
          gain.weighted_gain += weights[w * 64 + std::countr_zero(word)];
        }
      }
    }
  }

  void EvaluateFastCoverage(std::span<const Measurement> measurements,
                            std::span<FastCoverage> coverages,
                            const std::atomic<bool>* cancelled) const override {
    EvaluateFast(measurements, false, cancelled,
                 [&](size_t i, const ScanInPart&, FastScan& scan, Feasibility feasibility) {
                   coverages[i].feasibility = feasibility;
                   coverages[i].covered = feasibility == Feasibility::kFeasible
                                              ? std::move(scan.covered)
                                              : TargetBits(targets_.size());
                 });
  }

  const UncertaintyModel* uncertainty() const override {
    return definition_.uncertainty ? &*definition_.uncertainty : nullptr;
  }
  const TargetPriors* priors() const override { return priors_ ? &*priors_ : nullptr; }

  void EvaluateInformation(std::span<const Measurement> measurements,
                           std::span<FastInformation> results,
                           const std::atomic<bool>* cancelled) const override {
    EvaluateFast(measurements, true, cancelled,
                 [&](size_t i, const ScanInPart& in_part, FastScan& scan, Feasibility feasibility) {
                   results[i].feasibility = feasibility;
                   if (feasibility != Feasibility::kFeasible) {
                     results[i].covered = TargetBits(targets_.size());
                     return;
                   }
                   results[i].covered = std::move(scan.covered);
                   std::vector<float> density(scan.seen.size());
                   estimator_->Estimate(in_part, scan.seen, density);
                   ScanInformation& information = results[i].information;
                   information.targets.reserve(density.size());
                   information.density.reserve(density.size());
                   for (size_t k = 0; k < density.size(); ++k) {
                     if (!(density[k] > 0)) continue;
                     information.targets.push_back(scan.seen[k].target);
                     information.density.push_back(density[k]);
                   }
                 });
  }

  void EvaluateUncertaintyGains(std::span<const Measurement> measurements,
                                const UncertaintyRequirement& requirement,
                                std::span<UncertaintyGain> gains,
                                const std::atomic<bool>* cancelled) const override {
    std::vector<FastInformation> scans(measurements.size());
    EvaluateInformation(measurements, scans, cancelled);
    if (cancelled != nullptr && cancelled->load()) return;
    const UncertaintyValue value(*priors_, measurable_, requirement);
    for (size_t i = 0; i < scans.size(); ++i) {
      gains[i] = {.feasibility = scans[i].feasibility};
      if (scans[i].feasibility != Feasibility::kFeasible) continue;
      scans[i].covered &= measurable_;
      gains[i].covered_targets = static_cast<int32_t>(scans[i].covered.Count());
      gains[i].new_targets = value.NewAdmissible(scans[i].information);
      gains[i].gain = requirement.target_weights.empty()
                          ? value.Gain(scans[i].information, scans[i].covered)
                          : value.WeightedShare(scans[i].information, requirement.target_weights);
    }
  }

  MeasuredScan MeasureForInference(const Measurement& measurement,
                                   const std::atomic<bool>* cancelled) const override {
    // A growing plan is queried many times.
    const std::string key = MeasurementKey(measurement);
    if (const auto known = inferred_scans_.Get(key)) return *known;
    std::vector<MeasurementPoint> points;
    MeasuredScan scan;
    scan.feasibility = EvaluateExact(measurement, &points, cancelled).feasibility;
    if (cancelled != nullptr && cancelled->load()) return scan;
    if (scan.feasibility == Feasibility::kFeasible) {
      scan.points = std::make_shared<ScanPoints>(
          MakeScanInPart(definition_.rig, part_centre_m_, measurement, Depth(measurement)),
          *definition_.uncertainty, points, static_cast<float>(priors_->largest_neighbourhood_m()));
    }
    // A scan without points takes some hundred bytes.
    const int64_t bytes = 512 + (scan.points ? scan.points->bytes() : 0);
    inferred_scans_.Put(key, std::make_shared<MeasuredScan>(scan), bytes).IgnoreError();
    return scan;
  }

  void Infer(std::span<const std::shared_ptr<const ScanPoints>> scans,
             std::span<const uint32_t> targets, bool after_each_scan,
             std::span<const float> enough_m, std::span<TargetUncertainty> results,
             const std::atomic<bool>* cancelled) const override {
    InferTargets(targets_, *priors_, definition_.sampling.max_normal_angle_rad, scans, targets,
                 after_each_scan, enough_m, results, cancelled);
  }

  ExactCoverage EvaluateExact(const Measurement& measurement, std::vector<MeasurementPoint>* points,
                              const std::atomic<bool>* cancelled) const override {
    ExactCoverage coverage;
    coverage.covered = TargetBits(targets_.size());
    coverage.covered_without_normal_gate = TargetBits(targets_.size());
    if (!domain_.Contains(measurement)) {
      coverage.feasibility = Feasibility::kOutOfBounds;
      return coverage;
    }
    const auto measured = MeasuredPoints(measurement, cancelled);
    if (!measured->empty()) {
      coverage.first_frame = measured->front().frame;
      coverage.last_frame = measured->back().frame;
      coverage.feasibility =
          CheckFeasibility(measurement, coverage.first_frame * definition_.rig.scan_step_m,
                           coverage.last_frame * definition_.rig.scan_step_m);
    }
    MarkCovered(*measured, &coverage);
    if (points != nullptr) *points = *measured;
    return coverage;
  }

  ExactCoverage EvaluateDisplaced(const Measurement& measurement,
                                  const ScanDisplacement& displacement,
                                  const std::atomic<bool>* cancelled) const override {
    ExactCoverage coverage;
    coverage.covered = TargetBits(targets_.size());
    coverage.covered_without_normal_gate = TargetBits(targets_.size());
    if (!domain_.Contains(measurement)) {
      coverage.feasibility = Feasibility::kOutOfBounds;
      return coverage;
    }
    const ScanGeometry geometry =
        Displaced(MakeScanGeometry(definition_.rig, measurement), displacement);
    const std::vector<MeasurementPoint> measured =
        MeasureScan(definition_.part, definition_.rig, part_centre_m_, occluders_, geometry,
                    Depth(measurement), cancelled, light_.get());
    if (!measured.empty()) {
      coverage.first_frame = measured.front().frame;
      coverage.last_frame = measured.back().frame;
      // The clearance is a margin for displacements, so it does not apply here.
      Rig rig = definition_.rig;
      rig.clearance_m = 0;
      if (Collides(rig, geometry, part_centre_m_, occluders_,
                   coverage.first_frame * rig.scan_step_m, coverage.last_frame * rig.scan_step_m)) {
        coverage.feasibility = Feasibility::kCollision;
      }
    }
    MarkCovered(measured, &coverage);
    return coverage;
  }

  void Explain(const MeasurementDomain& domain, std::span<const uint32_t> targets,
               std::span<TargetExplanation> results,
               const std::atomic<bool>* cancelled) const override {
    ExplanationTask task;
    task.rig = &definition_.rig;
    task.domain = &domain;
    task.targets = &targets_;
    task.sampling = &definition_.sampling;
    task.occluders = &occluders_;
    task.part_centre_m = part_centre_m_;
    task.light = light_.get();
    std::call_once(single_obstacles_made_, [this] {
      for (size_t i = 1; i < occluders_.size(); ++i) single_obstacles_.push_back({occluders_[i]});
    });
    task.single_obstacles = &single_obstacles_;
    task.carry_out = [&](const Measurement& measurement, double stage_m) {
      CarriedOut result;
      EvaluateFast({&measurement, 1}, false, cancelled,
                   [&](size_t, const ScanInPart&, const FastScan& scan, Feasibility) {
                     // The estimate may cover nothing, not even the targets asked for.
                     const bool none = scan.stage_start_m > scan.stage_end_m;
                     result.stage_start_m = none ? stage_m : std::min(stage_m, scan.stage_start_m);
                     result.stage_end_m = none ? stage_m : std::max(stage_m, scan.stage_end_m);
                     result.feasibility =
                         CheckFeasibility(measurement, result.stage_start_m, result.stage_end_m);
                   });
      return result;
    };
    ExplainTargets(task, targets, results, cancelled);
  }

 private:
  // The targets that the points of a feasible scan cover.
  void MarkCovered(const std::vector<MeasurementPoint>& measured, ExactCoverage* coverage) const {
    coverage->measurement_points = static_cast<int64_t>(measured.size());
    if (coverage->feasibility != Feasibility::kFeasible) return;
    for (const MeasurementPoint& p : measured) {
      lookup_->Mark(p.position_m, p.normal, coverage->covered,
                    coverage->covered_without_normal_gate);
    }
  }

  std::shared_ptr<const MeasuredScans::Points> MeasuredPoints(
      const Measurement& measurement, const std::atomic<bool>* cancelled) const {
    if (auto known = measured_scans_.Find(measurement); known != nullptr) return known;
    auto measured = std::make_shared<const MeasuredScans::Points>(
        MeasureScan(definition_.part, definition_.rig, part_centre_m_, occluders_, measurement,
                    Depth(measurement), cancelled, light_.get()));
    // A cancelled scan lacks some of its points, so it is not cached.
    if (cancelled == nullptr || !cancelled->load()) measured_scans_.Add(measurement, measured);
    return measured;
  }

  // Prepares the data of the part that obstacles on the table and travelling boxes need.
  absl::Status FindTable(const std::atomic<bool>* cancelled) {
    bool on_table = false;
    for (const SceneObstacle& obstacle : definition_.obstacles) {
      on_table = on_table || obstacle.frame == ObstacleFrame::kTable;
      if (obstacle.frame != ObstacleFrame::kTable && obstacle.frame != ObstacleFrame::kStage) {
        continue;
      }
      if (IsBox(obstacle.mesh)) {
        const Eigen::AlignedBox3d box = obstacle.mesh.BoundingBox();
        boxes_.push_back({obstacle.frame, box.min().cast<float>(), box.max().cast<float>()});
      }
    }
    definition_.rig.part_support_points_m.reset();
    if (!on_table) return absl::OkStatus();
    SIGHTLINE_ASSIGN_OR_RETURN(auto corners, HullCorners(definition_.part.positions_m, cancelled));
    for (Eigen::Vector3d& corner : corners) corner -= part_centre_m_;
    definition_.rig.part_support_points_m =
        std::make_shared<const std::vector<Eigen::Vector3d>>(std::move(corners));
    return absl::OkStatus();
  }

  // True if the mesh is a box along its axes.
  static bool IsBox(const TriangleMesh& mesh) {
    const Eigen::AlignedBox3d box = mesh.BoundingBox();
    for (const Eigen::Vector3f& p : mesh.positions_m) {
      for (int axis = 0; axis < 3; ++axis) {
        if (p[axis] != static_cast<float>(box.min()[axis]) &&
            p[axis] != static_cast<float>(box.max()[axis])) {
          return false;
        }
      }
    }
    double area_m2 = 0;
    for (size_t t = 0; t < mesh.triangles.size(); ++t) area_m2 += mesh.Area(t);
    const Eigen::Vector3d size = box.sizes();
    const double surface_m2 = 2 * (size.x() * size.y() + size.y() * size.z() + size.z() * size.x());
    return std::abs(area_m2 - surface_m2) <= 1e-6 * surface_m2;
  }

  // The boxes that reach as high as a sensor, in part coordinates.
  std::vector<TravellingBox> BoxesOf(const Measurement& m) const {
    std::vector<TravellingBox> boxes;
    if (boxes_.empty()) return boxes;
    const ScanGeometry g = MakeScanGeometry(definition_.rig, m);
    for (const Box& box : boxes_) {
      const double base_m = box.frame == ObstacleFrame::kTable ? g.table_height_m : 0;
      const double top_m = g.part_offset_m.z() + base_m + box.high.z();
      // An obstacle on the table may stand beside the part: it hides points lower than its top.
      const bool below_part = box.frame == ObstacleFrame::kTable && box.high.z() <= 0;
      TravellingBox& travelling = boxes.emplace_back();
      travelling.low = box.low;
      travelling.high = box.high;
      travelling.hides_camera = !below_part || g.camera.origin_m.z() <= top_m;
      travelling.hides_laser = !below_part || g.laser.origin_m.z() <= top_m;
      if (!travelling.hides_camera && !travelling.hides_laser) {
        boxes.pop_back();
        continue;
      }
      travelling.rotation = g.part_rotation.cast<float>();
      travelling.shift =
          (-(g.part_rotation * part_centre_m_) - Eigen::Vector3d(0, 0, base_m)).cast<float>();
    }
    return boxes;
  }

  void MarkMeasurableTargets(const SceneBuildOptions& options) {
    const auto mark = [&](const DirectionLimits& limits, TargetBits& measurable) {
      ForTargetShares(options.threads, [&](size_t begin, size_t end) {
        MarkMeasurable(targets_, *field_, occluders_, limits, begin, end, measurable,
                       options.cancelled);
      });
    };
    const DirectionLimits free_space{kMinTriangulationRad, kMaxTriangulationRad};
    mark(free_space, measurable_);
    measurable_in_free_space_ = measurable_;
    DirectionLimits limits = free_space;
    limits.min_cos_incidence = LeastCosineOfIncidence();
    if (light_ != nullptr) {
      limits.light = light_.get();
      limits.light_map = light_map_.get();
      limits.laser_distance_m = definition_.rig.laser.distance_m;
    }
    if (definition_.domain) {
      const DomainMeasurability by_domain(definition_.rig, definition_.sampling,
                                          *definition_.domain, part_centre_m_, *field_, occluders_,
                                          light_.get(), light_map_.get());
      const size_t orientations = definition_.domain->resting_orientations.size();
      if (orientations > 0 && orientations <= 64) {
        measurable_orientations_.assign(targets_.size(), 0);
      }
      if (!by_domain.any_orientation()) {
        ForTargetShares(options.threads, [&](size_t begin, size_t end) {
          by_domain.Keep(targets_, begin, end, options.cancelled, measurable_,
                         measurable_orientations_);
        });
        return;
      }
      limits.min_angle_rad = std::max(limits.min_angle_rad, by_domain.min_angle_rad());
      limits.max_angle_rad = std::min(limits.max_angle_rad, by_domain.max_angle_rad());
    }
    if (limits == free_space) return;
    TargetBits narrowed(targets_.size());
    if (limits.min_angle_rad <= limits.max_angle_rad) mark(limits, narrowed);
    measurable_ &= narrowed;
  }

  // Calls work(begin, end) for shares of the targets, each in a thread of its own (0: as many as
  // there are cores). Shares are whole blocks: no two threads write one word of a bit set.
  template <typename Work>
  void ForTargetShares(int wanted_threads, const Work& work) const {
    const size_t threads =
        wanted_threads > 0 ? wanted_threads : std::max(1u, std::thread::hardware_concurrency());
    const size_t share = (field_->blocks() + threads - 1) / threads * kTargetsPerBlock;
    WorkerThreads pool;
    for (size_t i = 0; i < threads; ++i) {
      const size_t begin = std::min(targets_.size(), i * share),
                   end = std::min(targets_.size(), begin + share);
      pool.Start([&work, begin, end] { work(begin, end); });
    }
    pool.Join();
  }

  // Calls take(index, scan in part axes, fast scan, feasibility) for every measurement.
  template <typename Take>
  void EvaluateFast(std::span<const Measurement> measurements, bool with_seen,
                    const std::atomic<bool>* cancelled, const Take& take) const {
    // Small enough that scan data and results stay in cache while a block is worked on.
    constexpr size_t kBatch = 128;
    for (size_t begin = 0; begin < measurements.size(); begin += kBatch) {
      const size_t count = std::min(kBatch, measurements.size() - begin);
      std::vector<ScanInPart> scans;
      scans.reserve(count);
      for (size_t i = 0; i < count; ++i) {
        const Measurement& m = measurements[begin + i];
        scans.push_back(MakeScanInPart(definition_.rig, part_centre_m_, m, Depth(m)));
        scans.back().boxes = BoxesOf(m);
      }
      std::vector<FastScan> results(count);
      fast_->Evaluate(scans, results, with_seen, cancelled);
      if (cancelled != nullptr && cancelled->load()) return;
      for (size_t i = 0; i < count; ++i) {
        take(begin + i, scans[i], results[i],
             CheckFeasibility(measurements[begin + i], results[i].stage_start_m,
                              results[i].stage_end_m));
      }
    }
  }

  PointLimits Depth(const Measurement& m) const {
    const TargetSampling& sampling = definition_.sampling;
    PointLimits depth =
        AdmissibleDepth(definition_.rig, m.camera_distance_m, sampling.max_pixel_footprint_m,
                        sampling.max_circle_of_confusion_px);
    if (sampling.max_depth_per_pixel_m) {
      depth.max_depth_times_distance_m2 =
          MaxDepthTimesDistance(definition_.rig.camera, m, *sampling.max_depth_per_pixel_m);
    }
    depth.min_cos_incidence = LeastCosineOfIncidence();
    return depth;
  }

  // 0 if the limit on incidence is 90 degrees.
  double LeastCosineOfIncidence() const {
    const std::optional<double>& incidence_rad = definition_.sampling.max_incidence_rad;
    return incidence_rad ? std::max(0.0, std::cos(*incidence_rad)) : 0;
  }

  // A scan without points uses no travel and touches nothing.
  Feasibility CheckFeasibility(const Measurement& m, double stage_start_m,
                               double stage_end_m) const {
    if (!domain_.Contains(m)) return Feasibility::kOutOfBounds;
    if (stage_start_m > stage_end_m) return Feasibility::kFeasible;
    if (stage_end_m - stage_start_m > definition_.rig.stage_travel_m) return Feasibility::kTravel;
    if (Collides(definition_.rig, MakeScanGeometry(definition_.rig, m), part_centre_m_, occluders_,
                 stage_start_m, stage_end_m)) {
      return Feasibility::kCollision;
    }
    return Feasibility::kFeasible;
  }

  SceneDefinition definition_;
  Eigen::Vector3d part_centre_m_;
  MeasurementDomain domain_;
  TargetSet targets_;
  TargetBits measurable_, measurable_in_free_space_;
  std::vector<uint64_t> measurable_orientations_;
  // Boxes that travel with the stage: the only obstacles that the fast estimate considers.
  struct Box {
    ObstacleFrame frame;
    Eigen::Vector3f low, high;
  };
  std::vector<Box> boxes_;
  std::vector<Occluder> occluders_;
  // Obstacles one by one; made when targets are explained for the first time.
  mutable std::once_flag single_obstacles_made_;
  mutable std::vector<std::vector<Occluder>> single_obstacles_;
  std::unique_ptr<VisibilityField> field_;
  // Null if light limits nothing.
  std::unique_ptr<LightLimit> light_;
  std::unique_ptr<LightMap> light_map_;
  std::unique_ptr<FastEvaluator> fast_;
  std::unique_ptr<TargetLookup> lookup_;
  // Only with an uncertainty model.
  std::optional<TargetPriors> priors_;
  std::unique_ptr<InformationEstimator> estimator_;
  mutable LruStore<MeasuredScan> inferred_scans_{kInferredScansBytes};
  MeasuredScans measured_scans_;
  SceneTimings timings_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<CoverageScene>> CoverageScene::Build(
    SceneDefinition definition, const SceneBuildOptions& options) {
  auto scene = std::make_unique<CoverageSceneImpl>(std::move(definition));
  SIGHTLINE_RETURN_IF_ERROR(scene->Init(options));
  return scene;
}

}  // namespace sightline
