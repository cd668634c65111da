// SPDX-License-Identifier: Apache-2.0
// State that all strategies share while they plan: limits, information of scans, exact scores,
// progress, the finished plan.
#pragma once

#include <array>
#include <chrono>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "planning/optimise/maximise.h"
#include "planning/optimise/search_space.h"
#include "planning/strategy/planner.h"
#include "planning/strategy/top_points.h"

namespace sightline {

class PlanRun {
 public:
  PlanRun(GainModel& gain_model, const PlannerRequest& request);

  GainModel& gain_model() { return gain_model_; }
  const PlannerRequest& request() const { return request_; }
  const SearchSpace& space() const { return space_; }
  int64_t measurable() const { return measurable_; }
  // Smallest number of satisfied targets that reaches the goal.
  int64_t goal_targets() const { return goal_targets_; }
  // Least worth that a further scan must add, in units of new targets.
  double min_gain() const { return min_gain_; }
  // Accumulated information of all targets before any scan.
  std::vector<float> NothingKnown() const {
    return std::vector<float>(gain_model_.measurable().size(), 0);
  }
  double GainAfter(std::span<const float> known, const TargetShares& scan) const {
    return StepGain(steps_, gain_model_.measurable(), known, scan);
  }
  // Gain of a scan given the accumulated information, as the search estimates it. It contains
  // partial steps if the gain model counts them.
  absl::StatusOr<double> Added(std::span<const float> known, const Measurement& scan,
                               const TargetShares& shares);
  // Worth of the accumulated information of all targets.
  double Worth(std::span<const float> known) const {
    return StepWorth(steps_, gain_model_.measurable(), known);
  }
  int64_t CountSatisfied(std::span<const float> known) const {
    return Satisfied(gain_model_.measurable(), known).Count();
  }
  int64_t evaluations() const { return gain_model_.evaluations() - evaluations_before_; }

  // True if interrupted or out of time.
  bool Stopped() const;
  // kInterrupted or kMaxTime; only when Stopped().
  StopReason stopped_reason() const;
  // True for the CANCELLED that a stopped objective or gain model returns.
  bool IsStop(const absl::Status& status) const {
    return Stopped() && !status.ok() && status.code() != absl::StatusCode::kUnavailable;
  }

  // Passes progress on, not more often than every 0.1 s unless `always`.
  void Report(const std::string& phase, int64_t scans, int64_t settled_targets,
              bool always = false);

  // Counts this fraction of the work as done before the first scan is chosen.
  void SetPrepared(double fraction) { prepared_ = fraction; }

  // Exact coverage, remembered per measurement. Pointers stay valid as long as the run.
  absl::StatusOr<std::vector<const ScanCoverage*>> Exact(std::span<const Measurement> scans);
  // Fractions of the required information that a single scan gives: exact for coverage, fast
  // estimates if only plans are scored.
  absl::StatusOr<TargetShares> SharesOf(const Measurement& scan);
  // Exact score; every scan must be feasible by exact evaluation.
  absl::StatusOr<PlanScore> Score(std::span<const Measurement> scans, bool thorough);
  bool ReachesGoal(const PlanScore& score) const { return score.Claimed() >= goal_targets_; }

  // Fast gains of batches of points of the unit cube, -1 for infeasible ones; the best enter `top`
  // if given. CANCELLED once Stopped(). `phase` and the counts are for progress.
  BatchObjective Gain(std::vector<float> known, TopPoints* top, std::string phase, int64_t scans);

  // Returns the finished plan: locked scans first in their order, then the others by greatest exact
  // gain. Infeasible `movable` scans are dropped; locked ones were checked before.
  absl::StatusOr<PlannerResult> Finish(std::span<const Measurement> movable, StopReason reason);

 private:
  // Computes curves and score of a finished plan.
  absl::Status ScoreFinished(std::span<const Measurement> scans, PlannerResult* result);

  GainModel& gain_model_;
  const PlannerRequest& request_;
  SearchSpace space_;
  int64_t measurable_;
  int64_t goal_targets_;
  std::vector<ShareStep> steps_;
  double min_gain_;
  int64_t evaluations_before_;
  std::chrono::steady_clock::time_point start_;
  std::chrono::steady_clock::time_point last_report_;
  double prepared_ = 0;
  std::map<std::array<double, kMeasurementParameters>, ScanCoverage> exact_;
};

const char* FeasibilityName(ScanFeasibility feasibility);

}  // namespace sightline
