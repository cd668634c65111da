// SPDX-License-Identifier: Apache-2.0
// Gain models with coverage given by formulas, for testing planners without a server.
#pragma once

#include <atomic>
#include <functional>
#include <numbers>
#include <span>
#include <vector>

#include "core/inspection/inspection.h"
#include "core/random/random.h"
#include "core/rig/scan_geometry.h"
#include "planning/strategy/gain_model.h"

namespace sightline {

// Coverage from a function of measurement and target number. Exact coverage may differ.
class FunctionGainModel : public GainModel {
 public:
  using Covers = std::function<bool(const Measurement&, size_t)>;
  using Feasibility = std::function<ScanFeasibility(const Measurement&)>;

  FunctionGainModel(size_t targets, Covers covers)
      : covers_(std::move(covers)), measurable_(targets) {
    exact_covers_ = covers_;
    for (size_t t = 0; t < targets; ++t) measurable_.Set(t);
  }

  void set_exact(Covers covers) { exact_covers_ = std::move(covers); }
  void set_feasibility(Feasibility f) { feasibility_ = exact_feasibility_ = std::move(f); }
  void set_exact_feasibility(Feasibility f) { exact_feasibility_ = std::move(f); }
  void RemoveMeasurable(size_t t) { measurable_.Reset(t); }

  const TargetBits& measurable() const override { return measurable_; }
  int64_t evaluations() const override { return evaluations_; }
  int64_t exact_evaluations() const { return exact_evaluations_; }

  absl::StatusOr<std::vector<ScanGain>> Gains(std::span<const Measurement> measurements,
                                              std::span<const float> known) override {
    std::vector<ScanGain> gains;
    const TargetBits covered = Satisfied(measurable_, known);
    for (const ScanCoverage& c : Evaluate(measurements, covers_, feasibility_)) {
      const auto fresh = static_cast<int32_t>(c.covered.CountNotIn(covered));
      gains.push_back({c.feasibility, fresh, static_cast<int32_t>(c.covered.Count()), 0,
                       static_cast<double>(fresh)});
    }
    std::atomic_ref(evaluations_) += static_cast<int64_t>(measurements.size());
    if (on_query_) on_query_();
    return gains;
  }
  absl::StatusOr<std::vector<ScanGain>> WeightedGains(std::span<const Measurement> measurements,
                                                      std::span<const float> weights) override {
    std::vector<ScanGain> gains;
    for (const ScanCoverage& c : Evaluate(measurements, covers_, feasibility_)) {
      ScanGain gain{c.feasibility, 0, static_cast<int32_t>(c.covered.Count()), 0, 0};
      for (size_t t = 0; t < weights.size(); ++t) {
        if (c.covered.Test(t)) gain.weighted_gain += static_cast<double>(weights[t]);
      }
      gains.push_back(gain);
    }
    std::atomic_ref(evaluations_) += static_cast<int64_t>(measurements.size());
    return gains;
  }
  absl::StatusOr<std::vector<ScanCoverage>> FastCoverage(
      std::span<const Measurement> measurements) override {
    std::atomic_ref(evaluations_) += static_cast<int64_t>(measurements.size());
    return Evaluate(measurements, covers_, feasibility_);
  }
  absl::StatusOr<std::vector<ScanCoverage>> ExactCoverage(
      std::span<const Measurement> measurements) override {
    std::atomic_ref(exact_evaluations_) += static_cast<int64_t>(measurements.size());
    return Evaluate(measurements, exact_covers_, exact_feasibility_);
  }

  // Called after every query of gains.
  void set_on_query(std::function<void()> on_query) { on_query_ = std::move(on_query); }

 private:
  std::vector<ScanCoverage> Evaluate(std::span<const Measurement> measurements,
                                     const Covers& covers, const Feasibility& feasibility) const {
    std::vector<ScanCoverage> result;
    for (const Measurement& m : measurements) {
      ScanCoverage coverage;
      coverage.covered = TargetBits(measurable_.size());
      if (feasibility) coverage.feasibility = feasibility(m);
      if (coverage.feasibility == ScanFeasibility::kFeasible) {
        for (size_t t = 0; t < measurable_.size(); ++t) {
          if (measurable_.Test(t) && covers(m, t)) coverage.covered.Set(t);
        }
        coverage.last_frame = 100;
      }
      result.push_back(std::move(coverage));
    }
    return result;
  }

  Covers covers_, exact_covers_;
  Feasibility feasibility_, exact_feasibility_;
  std::function<void()> on_query_;
  TargetBits measurable_;
  int64_t evaluations_ = 0;
  int64_t exact_evaluations_ = 0;
};

// A gain with weights, which it remembers.
class WeightedGainModel final : public FunctionGainModel {
 public:
  using FunctionGainModel::FunctionGainModel;
  absl::Status SetWeights(const GainWeights& weights) override {
    weights_ = weights;
    return absl::OkStatus();
  }
  const GainWeights& weights() const { return weights_; }

 private:
  GainWeights weights_;
};

// Targets on a line from 0 to 1, one every hundredth. A scan at offset y brings a share of 0.4 to
// those within 0.26 of y: any three scans satisfy a target. Exact scores are the same.
class ShareGainModel final : public GainModel {
 public:
  static constexpr size_t kTargets = 101;
  ShareGainModel() : judged_(kTargets) {
    for (size_t t = 0; t < kTargets; ++t) judged_.Set(t);
  }
  const TargetBits& measurable() const override { return judged_; }
  int64_t evaluations() const override { return evaluations_; }
  std::vector<ShareStep> steps() const override { return {{0.75, {1.0f}}, {0.25, {0.5f}}}; }
  bool ScoresPlans() const override { return true; }

  static TargetShares SharesOf(const Measurement& m) {
    TargetShares shares;
    for (uint32_t t = 0; t < kTargets; ++t) {
      if (std::abs(0.01 * t - m.offset_y_m) > 0.26) continue;
      shares.targets.push_back(t);
      shares.share.push_back(0.4f);
    }
    return shares;
  }
  absl::StatusOr<std::vector<ScanGain>> Gains(std::span<const Measurement> measurements,
                                              std::span<const float> known) override {
    evaluations_ += static_cast<int64_t>(measurements.size());
    std::vector<ScanGain> gains;
    for (const Measurement& m : measurements) {
      ScanGain& gain = gains.emplace_back();
      const TargetShares shares = SharesOf(m);
      for (const uint32_t t : shares.targets) {
        gain.new_targets += known[t] < 1 && known[t] + 0.4f >= 1;
        gain.gain += std::min(1.0f, known[t] + 0.4f) - std::min(1.0f, known[t]);
      }
    }
    return gains;
  }
  absl::StatusOr<std::vector<ScanGain>> WeightedGains(std::span<const Measurement> measurements,
                                                      std::span<const float> weights) override {
    evaluations_ += static_cast<int64_t>(measurements.size());
    std::vector<ScanGain> gains;
    for (const Measurement& m : measurements) {
      ScanGain& gain = gains.emplace_back();
      for (const uint32_t t : SharesOf(m).targets) gain.weighted_gain += 0.4 * weights[t];
    }
    return gains;
  }
  absl::StatusOr<std::vector<ScanCoverage>> FastCoverage(
      std::span<const Measurement> measurements) override {
    evaluations_ += static_cast<int64_t>(measurements.size());
    std::vector<ScanCoverage> result(measurements.size());
    for (size_t i = 0; i < result.size(); ++i) {
      result[i].covered = TargetBits(kTargets);
      result[i].shares = SharesOf(measurements[i]);
    }
    return result;
  }
  absl::StatusOr<std::vector<ScanCoverage>> ExactCoverage(
      std::span<const Measurement> measurements) override {
    std::vector<ScanCoverage> result(measurements.size());
    for (ScanCoverage& coverage : result) coverage.covered = TargetBits(kTargets);
    return result;
  }
  absl::StatusOr<PlanScore> ScorePlan(std::span<const Measurement> scans, bool) override {
    std::vector<float> known(kTargets, 0);
    for (const Measurement& m : scans) AddShares(SharesOf(m), known);
    const int64_t satisfied = Satisfied(judged_, known).Count();
    PlanScore score;
    score.satisfied = score.relaxed = satisfied;
    score.measurable = kTargets;
    return score;
  }
  absl::StatusOr<std::vector<PlanScore>> ScoreGrowingPlan(
      std::span<const Measurement> scans) override {
    std::vector<PlanScore> scores;
    for (size_t n = 1; n <= scans.size(); ++n) scores.push_back(*ScorePlan(scans.first(n), true));
    return scores;
  }

 private:
  TargetBits judged_;
  int64_t evaluations_ = 0;
};

// Bounds of Table 2.1.
inline MeasurementDomain NineParameterDomain() {
  constexpr double kDeg = std::numbers::pi / 180;
  MeasurementDomain domain;
  const auto range = [&](int i, double min, double max, bool periodic) {
    domain.parameters[i].ranges = {{min, max}};
    domain.parameters[i].periodic = periodic;
  };
  range(0, 0.1, 0.8, false);
  domain.parameters[1].ranges = {{-80 * kDeg, -10 * kDeg}, {10 * kDeg, 80 * kDeg}};
  range(2, 0, 360 * kDeg, true);
  range(3, 0, 90 * kDeg, false);
  for (int i = 4; i < 7; ++i) range(i, 0, 360 * kDeg, true);
  range(7, -0.5, 0.5, false);
  range(8, -0.4, 0.4, false);
  return domain;
}

// Everything fixed but the offset y in [0, 1].
inline MeasurementDomain OffsetDomain() {
  MeasurementDomain domain;
  const auto values = ToArray(Measurement{});
  for (int i = 0; i < kMeasurementParameters; ++i) domain.parameters[i].values = {values[i]};
  domain.parameters[7] = {{{0, 1}}, {}, false};
  return domain;
}

// Targets on a line; a scan at offset y covers those within 0.25 of y, so every target has a place
// in a window of width 0.5. Two windows, [0, 0.5] and [0.5, 1], cover all of them, and one cannot.
// The window of most targets is the middle one, [0.25, 0.75], with 40 of 60 against 30: greedy
// takes it first, and no single further window holds what is left at both ends. So greedy needs
// exactly three scans and the optimum is two, whatever the optimiser.
inline std::vector<double> GreedyTrapPositions() {
  std::vector<double> positions;
  for (int i = 0; i < 10; ++i) positions.push_back(0.02 + 0.022 * i);   // up to 0.218
  for (int i = 0; i < 20; ++i) positions.push_back(0.265 + 0.011 * i);  // up to 0.474
  for (int i = 0; i < 50; ++i) {
    if (i < 30) positions.push_back(1 - positions[static_cast<size_t>(i)]);
  }
  return positions;
}

inline FunctionGainModel GreedyTrapGainModel() {
  return FunctionGainModel(60, [positions = GreedyTrapPositions()](const Measurement& m, size_t t) {
    return std::abs(positions[t] - m.offset_y_m) <= 0.25;
  });
}

// A casting without a mesh: targets on the faces of a box, and targets in bores that are seen only
// from within a narrow cone about the bore's axis. Camera and laser must both lie in a target's
// cone at the moment it is lit, and the target in the camera's field of view. All nine parameters
// matter.
inline FunctionGainModel CastingGainModel(size_t targets, uint64_t seed) {
  struct Target {
    Eigen::Vector3d position, axis;
    double cos_cone;
  };
  std::vector<Target> all;
  Random random(seed);
  const Eigen::Vector3d half(0.2, 0.12, 0.05);
  std::vector<Eigen::Vector3d> bores;
  for (int b = 0; b < 12; ++b) {
    bores.push_back(
        Eigen::Vector3d(random.Normal(), random.Normal(), random.Normal()).normalized());
  }
  for (size_t t = 0; t < targets; ++t) {
    const bool bore = t % 3 == 0;
    Eigen::Vector3d axis =
        bore ? bores[(t / 3) % bores.size()]
             : Eigen::Vector3d(random.Normal(), random.Normal(), random.Normal()).normalized();
    const double reach = 1 / (axis.cwiseAbs().cwiseQuotient(half)).maxCoeff();
    Eigen::Vector3d position = axis * reach;
    if (bore) {
      position *= 0.5 + 0.5 * random.Uniform();
      axis = (axis + 0.15 * Eigen::Vector3d(random.Normal(), random.Normal(), random.Normal()))
                 .normalized();
    }
    const double cone_rad = bore ? 0.25 + 0.2 * random.Uniform() : 0.9 + 0.4 * random.Uniform();
    all.push_back({position, axis, std::cos(cone_rad)});
  }
  FunctionGainModel gain_model(targets, [all](const Measurement& m, size_t t) {
    static const Rig rig;
    // The geometry is the same for all targets of a measurement.
    thread_local Measurement last{.camera_distance_m = -1};
    thread_local ScanGeometry geometry;
    if (!(last == m)) {
      geometry = MakeScanGeometry(rig, m);
      last = m;
    }
    const Target& target = all[t];
    Eigen::Vector3d x = geometry.part_rotation * target.position + geometry.part_offset_m;
    if (std::abs(geometry.sheet_normal.x()) < 1e-3) return false;
    x.x() += geometry.LitStagePosition(x);
    const Eigen::Vector3d axis = geometry.part_rotation * target.axis;
    const Eigen::Vector3d to_camera = geometry.camera.origin_m - x;
    const Eigen::Vector3d to_laser = geometry.laser.origin_m - x;
    if (axis.dot(to_camera) < target.cos_cone * to_camera.norm()) return false;
    if (axis.dot(to_laser) < target.cos_cone * to_laser.norm()) return false;
    const double depth = -to_camera.dot(geometry.camera.z_axis);
    const double tangent = std::tan(0.5 * rig.camera.vertical_fov_rad);
    return depth > 0 && std::abs(to_camera.dot(geometry.camera.x_axis)) < tangent * depth &&
           std::abs(to_camera.dot(geometry.camera.y_axis)) < tangent * depth &&
           to_camera.norm() < rig.max_range_m;
  });
  // Camera and laser stay outside a ball about the part.
  gain_model.set_feasibility([](const Measurement& m) {
    return m.camera_distance_m < 0.2 + 0.3 * std::abs(m.offset_z_m) ? ScanFeasibility::kCollision
                                                                    : ScanFeasibility::kFeasible;
  });
  return gain_model;
}

}  // namespace sightline
