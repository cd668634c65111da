// SPDX-License-Identifier: Apache-2.0
#include "bench/common/scene_gain_model.h"

#include "bench/common/measure.h"

namespace sightline::bench {
namespace {

ScanFeasibility Convert(Feasibility feasibility) {
  switch (feasibility) {
    case Feasibility::kFeasible:
      return ScanFeasibility::kFeasible;
    case Feasibility::kCollision:
      return ScanFeasibility::kCollision;
    case Feasibility::kTravel:
      return ScanFeasibility::kTravel;
    case Feasibility::kOutOfBounds:
      return ScanFeasibility::kOutOfBounds;
  }
  return ScanFeasibility::kOutOfBounds;
}

}  // namespace

std::vector<ScanGain> SceneGainModel::GainsOf(std::span<const Measurement> measurements,
                                              const TargetBits* covered,
                                              std::span<const float> weights) {
  std::vector<FastGain> gains(measurements.size());
  scene_.EvaluateGains(measurements, covered, weights, gains, nullptr);
  evaluations_ += static_cast<int64_t>(measurements.size());
  std::vector<ScanGain> result;
  for (const FastGain& g : gains) {
    result.push_back({Convert(g.feasibility), g.new_targets, g.covered_targets, g.weighted_gain,
                      static_cast<double>(g.new_targets)});
  }
  return result;
}

absl::StatusOr<std::vector<ScanGain>> SceneGainModel::Gains(
    std::span<const Measurement> measurements, std::span<const float> known) {
  const TargetBits covered = Satisfied(scene_.measurable(), known);
  return GainsOf(measurements, &covered, {});
}

absl::StatusOr<std::vector<ScanGain>> SceneGainModel::WeightedGains(
    std::span<const Measurement> measurements, std::span<const float> weights) {
  return GainsOf(measurements, nullptr, weights);
}

absl::StatusOr<std::vector<ScanCoverage>> SceneGainModel::FastCoverage(
    std::span<const Measurement> measurements) {
  std::vector<sightline::FastCoverage> fast(measurements.size());
  scene_.EvaluateFastCoverage(measurements, fast, nullptr);
  evaluations_ += static_cast<int64_t>(measurements.size());
  std::vector<ScanCoverage> result(measurements.size());
  for (size_t i = 0; i < result.size(); ++i) {
    result[i].feasibility = Convert(fast[i].feasibility);
    result[i].covered = std::move(fast[i].covered);
    result[i].covered &= scene_.measurable();
  }
  return result;
}

absl::StatusOr<std::vector<ScanCoverage>> SceneGainModel::ExactCoverage(
    std::span<const Measurement> measurements) {
  std::vector<ScanCoverage> result(measurements.size());
  ParallelFor(2, measurements.size(), [&](size_t i) {
    sightline::ExactCoverage exact = scene_.EvaluateExact(measurements[i], nullptr, nullptr);
    exact.covered &= scene_.measurable();
    exact.covered_without_normal_gate &= scene_.measurable();
    result[i] = {Convert(exact.feasibility),
                 std::move(exact.covered),
                 std::move(exact.covered_without_normal_gate),
                 exact.first_frame,
                 exact.last_frame,
                 exact.measurement_points,
                 {},
                 {}};
  });
  return result;
}

}  // namespace sightline::bench
