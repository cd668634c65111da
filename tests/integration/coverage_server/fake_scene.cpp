// SPDX-License-Identifier: Apache-2.0
#include "tests/integration/coverage_server/fake_scene.h"

#include <chrono>
#include <cmath>
#include <fstream>
#include <numbers>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"

namespace sightline {
namespace {

// False if cancelled on the way.
bool Spend(absl::Duration time, const FakeOptions& options, const std::atomic<bool>* cancelled) {
  const auto end = std::chrono::steady_clock::now() + absl::ToChronoNanoseconds(time);
  const auto held = [&] { return options.hold != nullptr && *options.hold; };
  do {
    if (cancelled != nullptr && *cancelled) return false;
    if (time > absl::ZeroDuration() || held()) absl::SleepFor(absl::Milliseconds(1));
  } while (std::chrono::steady_clock::now() < end || held());
  return true;
}

class FakeScene final : public CoverageScene {
 public:
  FakeScene(SceneDefinition definition, const FakeOptions& options)
      : definition_(std::move(definition)), options_(options), measurable_(options.targets) {
    const Eigen::AlignedBox3d box = definition_.part.BoundingBox();
    for (size_t i = 0; i < options.targets; ++i) {
      const double t = static_cast<double>(i) / static_cast<double>(options.targets);
      targets_.positions_m.push_back((box.min() + t * box.sizes()).cast<float>());
      targets_.normals.push_back(Eigen::Vector3f::UnitZ());
      targets_.regions.push_back(-1);
      targets_.triangles.push_back(0);
      if (i % 10 != 0) measurable_.Set(i);
    }
    phase_ = 0.1 * static_cast<double>(definition_.part.triangles.size()) +
             0.01 * static_cast<double>(definition_.sampling.seed);
  }

  const TriangleMesh& part() const override { return definition_.part; }
  const Rig& rig() const override { return definition_.rig; }
  const std::vector<SceneObstacle>& obstacles() const override { return definition_.obstacles; }
  const TargetSet& targets() const override { return targets_; }
  const TargetBits& measurable() const override { return measurable_; }
  Eigen::Vector3d part_centre_m() const override { return definition_.part.BoundingBox().center(); }
  int64_t field_bytes() const override { return 1000; }
  const SceneTimings& timings() const override { return timings_; }

  void EvaluateGains(std::span<const Measurement> measurements, const TargetBits* covered,
                     std::span<const float> weights, std::span<FastGain> gains,
                     const std::atomic<bool>* cancelled) const override {
    for (size_t k = 0; k < measurements.size(); ++k) {
      gains[k] = {.feasibility = FeasibilityOf(measurements[k])};
      if (!Query(cancelled)) return;
      if (gains[k].feasibility != Feasibility::kFeasible) continue;
      TargetBits bits = Covered(measurements[k], kFastThreshold);
      bits &= measurable_;
      gains[k].covered_targets = static_cast<int32_t>(bits.Count());
      if (covered != nullptr) bits.Subtract(*covered);
      gains[k].new_targets = static_cast<int32_t>(bits.Count());
      for (size_t i = 0; !weights.empty() && i < bits.size(); ++i) {
        if (bits.Test(i)) gains[k].weighted_gain += weights[i];
      }
    }
  }

  void EvaluateFastCoverage(std::span<const Measurement> measurements,
                            std::span<FastCoverage> coverages,
                            const std::atomic<bool>* cancelled) const override {
    for (size_t k = 0; k < measurements.size(); ++k) {
      if (!Query(cancelled)) return;
      coverages[k].feasibility = FeasibilityOf(measurements[k]);
      if (coverages[k].feasibility != Feasibility::kFeasible) continue;
      coverages[k].covered = Covered(measurements[k], kFastThreshold);
    }
  }

  // Targets that cannot be measured are reported as hidden, all others as not chosen.
  void Explain(const MeasurementDomain&, std::span<const uint32_t> targets,
               std::span<TargetExplanation> results,
               const std::atomic<bool>* cancelled) const override {
    for (size_t i = 0; i < targets.size(); ++i) {
      if (!Query(cancelled)) return;
      results[i] = {measurable_.Test(targets[i]) ? UncoveredReason::kNotChosen
                                                 : UncoveredReason::kOwnOcclusion,
                    -1,
                    10,
                    5,
                    0,
                    {}};
    }
  }

  const UncertaintyModel* uncertainty() const override {
    return definition_.uncertainty ? &*definition_.uncertainty : nullptr;
  }

  // Covered targets, half of them admissible.
  void EvaluateUncertaintyGains(std::span<const Measurement> measurements,
                                const UncertaintyRequirement& requirement,
                                std::span<UncertaintyGain> gains,
                                const std::atomic<bool>* cancelled) const override {
    for (size_t k = 0; k < measurements.size(); ++k) {
      gains[k] = {.feasibility = FeasibilityOf(measurements[k])};
      if (!Query(cancelled)) return;
      if (gains[k].feasibility != Feasibility::kFeasible) continue;
      TargetBits bits = Covered(measurements[k], kFastThreshold);
      bits &= measurable_;
      gains[k].covered_targets = static_cast<int32_t>(bits.Count());
      gains[k].new_targets = gains[k].covered_targets / 2;
      gains[k].gain = requirement.weights.admissible * gains[k].new_targets;
    }
  }

  ExactCoverage EvaluateDisplaced(const Measurement& measurement, const ScanDisplacement&,
                                  const std::atomic<bool>* cancelled) const override {
    return EvaluateExact(measurement, nullptr, cancelled);
  }

  ExactCoverage EvaluateExact(const Measurement& measurement, std::vector<MeasurementPoint>* points,
                              const std::atomic<bool>* cancelled) const override {
    ExactCoverage coverage;
    coverage.feasibility = FeasibilityOf(measurement);
    if (!Query(cancelled) || coverage.feasibility != Feasibility::kFeasible) return coverage;
    coverage.covered = Covered(measurement, kExactThreshold);
    coverage.covered_without_normal_gate = Covered(measurement, kExactThreshold - 0.1);
    coverage.first_frame = -5;
    coverage.last_frame = static_cast<int32_t>(options_.targets) - 6;
    coverage.measurement_points = coverage.covered.Count();
    for (size_t i = 0; points != nullptr && i < options_.targets; ++i) {
      if (!coverage.covered.Test(i)) continue;
      points->push_back({targets_.positions_m[i], targets_.normals[i], static_cast<int32_t>(i) - 5,
                         static_cast<int32_t>(i % 512)});
    }
    return coverage;
  }

 private:
  static constexpr double kFastThreshold = 0.5;
  static constexpr double kExactThreshold = 0.48;

  static Feasibility FeasibilityOf(const Measurement& measurement) {
    if (measurement.part_gamma_rad > 350 * std::numbers::pi / 180) return Feasibility::kCollision;
    if (measurement.offset_y_m > 0.45) return Feasibility::kTravel;
    return Feasibility::kFeasible;
  }

  TargetBits Covered(const Measurement& measurement, double threshold) const {
    double phase = phase_;
    int k = 0;
    for (const double value : ToArray(measurement)) phase += value * ++k;
    TargetBits bits(options_.targets);
    for (size_t i = 0; i < options_.targets; ++i) {
      if (std::cos(0.37 * static_cast<double>(i) + phase) > threshold) bits.Set(i);
    }
    return bits;
  }

  bool Query(const std::atomic<bool>* cancelled) const {
    FakeCounters* counters = options_.counters;
    if (counters != nullptr) {
      ++counters->queries_started;
      ++counters->queries_running;
    }
    if (!options_.query_file.empty()) std::ofstream(options_.query_file).flush();
    const bool finished = Spend(options_.query_time, options_, cancelled);
    if (counters != nullptr) {
      --counters->queries_running;
      if (finished) ++counters->queries_finished;
    }
    return finished;
  }

  SceneDefinition definition_;
  FakeOptions options_;
  TargetSet targets_;
  TargetBits measurable_;
  SceneTimings timings_{0.1, 0.2, 0.3};
  double phase_ = 0;
};

}  // namespace

std::unique_ptr<CoverageScene> MakeFakeScene(SceneDefinition definition,
                                             const FakeOptions& options) {
  return std::make_unique<FakeScene>(std::move(definition), options);
}

CoverageBackend MakeFakeBackend(const FakeOptions& options) {
  CoverageBackend backend;
  backend.build_scene =
      [options](SceneDefinition definition,
                const SceneBuildOptions& build) -> absl::StatusOr<std::unique_ptr<CoverageScene>> {
    if (options.counters != nullptr) ++options.counters->builds_started;
    constexpr int kSteps = 4;
    for (int step = 0; step < kSteps; ++step) {
      if (build.on_progress) {
        build.on_progress(static_cast<double>(step) / kSteps, absl::StrCat("step ", step));
      }
      if (!Spend(options.build_time / kSteps, options, build.cancelled)) {
        return absl::CancelledError("cancelled");
      }
    }
    if (options.counters != nullptr) ++options.counters->builds_finished;
    return MakeFakeScene(std::move(definition), options);
  };
  backend.render_view = [](const CoverageScene&,
                           const ViewRequest& request) -> absl::StatusOr<std::string> {
    return absl::StrCat("\x89PNG fake ", request.columns_px, "x", request.rows_px, " covered ",
                        request.covered.Count());
  };
  return backend;
}

}  // namespace sightline
