// SPDX-License-Identifier: Apache-2.0
// Gain model in which scans that a robot cannot make are infeasible; they are sorted out before any
// query. Thread-safe if the wrapped gain model is; call Keep before.
#pragma once

#include <array>
#include <atomic>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <span>
#include <vector>

#include "planning/robot/robot_cell.h"
#include "planning/strategy/gain_model.h"

namespace sightline {

class ReachableGainModel final : public GainModel {
 public:
  // `travel_of` returns the stage positions between which a scan is expected to measure. If its
  // frames are known, they count as well.
  ReachableGainModel(std::unique_ptr<GainModel> gain_model, std::shared_ptr<const RobotCell> cell,
                     std::function<ScanTravel(const Measurement&)> travel_of, double scan_step_m)
      : gain_model_(std::move(gain_model)),
        cell_(std::move(cell)),
        travel_of_(std::move(travel_of)),
        scan_step_m_(scan_step_m) {}

  // Accepts these scans as they are, even if the robot does not reach them.
  void Keep(std::span<const Measurement> scans);

  const TargetBits& measurable() const override { return gain_model_->measurable(); }
  const TargetBits& validation_measurable() const override {
    return gain_model_->validation_measurable();
  }
  absl::StatusOr<std::vector<ScanGain>> Gains(std::span<const Measurement> measurements,
                                              std::span<const float> known) override;
  absl::StatusOr<std::vector<ScanGain>> WeightedGains(std::span<const Measurement> measurements,
                                                      std::span<const float> weights) override;
  absl::StatusOr<std::vector<ScanCoverage>> FastCoverage(
      std::span<const Measurement> measurements) override;
  absl::StatusOr<std::vector<ScanCoverage>> ExactCoverage(
      std::span<const Measurement> measurements) override;
  // The count includes scans that the robot does not reach.
  int64_t evaluations() const override { return gain_model_->evaluations() + unreached_; }

  absl::Status SetWeights(const GainWeights& weights) override {
    return gain_model_->SetWeights(weights);
  }
  std::vector<ShareStep> steps() const override { return gain_model_->steps(); }
  bool ScoresPlans() const override { return gain_model_->ScoresPlans(); }
  absl::StatusOr<PlanScore> ScorePlan(std::span<const Measurement> scans, bool thorough) override {
    return gain_model_->ScorePlan(scans, thorough);
  }
  absl::StatusOr<std::vector<PlanScore>> ScoreGrowingPlan(
      std::span<const Measurement> scans) override {
    return gain_model_->ScoreGrowingPlan(scans);
  }

 private:
  using Key = std::array<double, kMeasurementParameters>;

  // One element per scan: true if the robot reaches it or if it is kept.
  std::vector<bool> Reached(std::span<const Measurement> measurements);
  // Answers of the gain model for reachable scans, at their indices among all.
  template <typename Answer, typename Ask>
  absl::StatusOr<std::vector<Answer>> OfReached(std::span<const Measurement> measurements,
                                                const Ask& ask,
                                                const std::function<Answer()>& unreached);
  ScanCoverage Unreached() const;

  const std::unique_ptr<GainModel> gain_model_;
  const std::shared_ptr<const RobotCell> cell_;
  const std::function<ScanTravel(const Measurement&)> travel_of_;
  const double scan_step_m_;
  std::set<Key> kept_;
  std::mutex mutex_;
  std::map<Key, bool> reached_;  // earlier answers; under the mutex
  std::atomic<int64_t> unreached_ = 0;
};

}  // namespace sightline
