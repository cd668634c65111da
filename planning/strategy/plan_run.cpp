// SPDX-License-Identifier: Apache-2.0
#include "planning/strategy/plan_run.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "core/status/status_macros.h"

namespace sightline {

PlanRun::PlanRun(GainModel& gain_model, const PlannerRequest& request)
    : gain_model_(gain_model),
      request_(request),
      space_(request.domain),
      measurable_(gain_model.measurable().Count()),
      goal_targets_(static_cast<int64_t>(
          std::ceil(GoalFraction(request.goal) * static_cast<double>(measurable_) - 1e-9))),
      steps_(gain_model.steps()),
      evaluations_before_(gain_model.evaluations()),
      start_(std::chrono::steady_clock::now()) {
  double whole = 0;
  for (const ShareStep& step : steps_) whole += step.weight;
  min_gain_ =
      whole * static_cast<double>(std::max<int64_t>(
                  1, static_cast<int64_t>(std::ceil(
                         request.goal.min_gain * static_cast<double>(measurable_) - 1e-9))));
}

bool PlanRun::Stopped() const {
  if (request_.interrupted != nullptr && *request_.interrupted) return true;
  return request_.goal.max_time_s && std::chrono::steady_clock::now() - start_ >
                                         std::chrono::duration<double>(*request_.goal.max_time_s);
}

StopReason PlanRun::stopped_reason() const {
  return request_.interrupted != nullptr && *request_.interrupted ? StopReason::kInterrupted
                                                                  : StopReason::kMaxTime;
}

void PlanRun::Report(const std::string& phase, int64_t scans, int64_t settled_targets,
                     bool always) {
  if (!request_.on_progress) return;
  const auto now = std::chrono::steady_clock::now();
  if (!always && now - last_report_ < std::chrono::milliseconds(100)) return;
  last_report_ = now;
  const double total = static_cast<double>(std::max<int64_t>(1, measurable_));
  const double coverage = static_cast<double>(settled_targets) / total;
  const double goal = GoalFraction(request_.goal);
  const double done = prepared_ + (1 - prepared_) * std::min(1.0, coverage / goal);
  request_.on_progress({static_cast<int>(scans), coverage, goal, evaluations(), done, phase});
}

absl::StatusOr<std::vector<const ScanCoverage*>> PlanRun::Exact(
    std::span<const Measurement> scans) {
  std::vector<Measurement> missing;
  for (const Measurement& scan : scans) {
    if (!exact_.contains(ToArray(scan)) &&
        std::find(missing.begin(), missing.end(), scan) == missing.end()) {
      missing.push_back(scan);
    }
  }
  if (!missing.empty()) {
    SIGHTLINE_ASSIGN_OR_RETURN(auto coverage, gain_model_.ExactCoverage(missing));
    if (coverage.size() != missing.size()) {
      return absl::InternalError(
          absl::StrCat("exact coverage of ", coverage.size(), " of ", missing.size(), " scans"));
    }
    for (size_t i = 0; i < missing.size(); ++i) {
      exact_[ToArray(missing[i])] = std::move(coverage[i]);
    }
  }
  std::vector<const ScanCoverage*> result;
  for (const Measurement& scan : scans) result.push_back(&exact_.at(ToArray(scan)));
  return result;
}

absl::StatusOr<TargetShares> PlanRun::SharesOf(const Measurement& scan) {
  if (!gain_model_.ScoresPlans()) {
    SIGHTLINE_ASSIGN_OR_RETURN(auto exact, Exact({&scan, 1}));
    return FullShares(exact.front()->covered);
  }
  SIGHTLINE_ASSIGN_OR_RETURN(auto fast, gain_model_.FastCoverage({&scan, 1}));
  return std::move(fast.front().shares);
}

absl::StatusOr<double> PlanRun::Added(std::span<const float> known, const Measurement& scan,
                                      const TargetShares& shares) {
  if (!gain_model_.ScoresPlans()) return GainAfter(known, shares);
  SIGHTLINE_ASSIGN_OR_RETURN(auto gains, gain_model_.Gains({&scan, 1}, known));
  return gains.front().gain;
}

absl::StatusOr<PlanScore> PlanRun::Score(std::span<const Measurement> scans, bool thorough) {
  if (gain_model_.ScoresPlans()) return gain_model_.ScorePlan(scans, thorough);
  SIGHTLINE_ASSIGN_OR_RETURN(auto exact, Exact(scans));
  TargetBits covered(gain_model_.measurable().size()),
      fresh(gain_model_.validation_measurable().size());
  for (const ScanCoverage* scan : exact) {
    if (scan->feasibility != ScanFeasibility::kFeasible) continue;
    covered |= scan->covered;
    if (fresh.size() > 0) fresh |= scan->validation_covered;
  }
  PlanScore score;
  score.measurable = measurable_;
  score.satisfied = score.relaxed = covered.Count();
  if (fresh.size() > 0) {
    score.validation_measurable = gain_model_.validation_measurable().Count();
    score.validation_satisfied = score.validation_relaxed = fresh.Count();
  }
  return score;
}

BatchObjective PlanRun::Gain(std::vector<float> known, TopPoints* top, std::string phase,
                             int64_t scans) {
  const int64_t satisfied = CountSatisfied(known);
  return [this, known = std::move(known), top, phase = std::move(phase), scans, satisfied](
             std::span<const std::vector<double>> points) -> absl::StatusOr<std::vector<double>> {
    if (Stopped()) return absl::CancelledError("planning was stopped");
    std::vector<Measurement> measurements;
    measurements.reserve(points.size());
    for (const auto& x : points) measurements.push_back(space_.ToMeasurement(x));
    SIGHTLINE_ASSIGN_OR_RETURN(auto gains, gain_model_.Gains(measurements, known));
    std::vector<double> values;
    values.reserve(gains.size());
    for (size_t i = 0; i < gains.size(); ++i) {
      const ScanGain& gain = gains[i];
      values.push_back(gain.feasibility == ScanFeasibility::kFeasible ? gain.gain : -1);
      if (top != nullptr && values.back() > 0) {
        top->Add(space_.Normalise(points[i]), values.back());
      }
    }
    Report(phase, scans, satisfied);
    return values;
  };
}

absl::StatusOr<PlannerResult> PlanRun::Finish(std::span<const Measurement> movable,
                                              StopReason reason) {
  std::vector<Measurement> scans = request_.locked;
  const size_t locked = scans.size();
  scans.insert(scans.end(), movable.begin(), movable.end());
  SIGHTLINE_ASSIGN_OR_RETURN(auto exact, Exact(scans));
  std::vector<TargetShares> shares;
  for (const Measurement& scan : scans) {
    SIGHTLINE_ASSIGN_OR_RETURN(auto told, SharesOf(scan));
    shares.push_back(std::move(told));
  }

  std::vector<float> known = NothingKnown();
  PlannerResult result;
  result.stop_reason = reason;
  std::vector<bool> used(scans.size(), false);
  for (size_t place = 0; place < scans.size(); ++place) {
    size_t best = scans.size();
    double best_gain = -1;
    for (size_t i = place < locked ? place : locked;
         i < (place < locked ? place + 1 : scans.size()); ++i) {
      if (used[i] || (i >= locked && exact[i]->feasibility != ScanFeasibility::kFeasible)) {
        continue;
      }
      const double gain = GainAfter(known, shares[i]);
      if (gain > best_gain) {
        best_gain = gain;
        best = i;
      }
    }
    if (best == scans.size()) break;
    used[best] = true;
    AddShares(shares[best], known);
    ChosenScan chosen;
    chosen.measurement = scans[best];
    chosen.locked = best < locked;
    chosen.exact = *exact[best];
    result.scans.push_back(std::move(chosen));
  }
  result.evaluations = evaluations();
  std::vector<Measurement> chosen;
  for (const ChosenScan& scan : result.scans) chosen.push_back(scan.measurement);
  if (!chosen.empty()) {
    SIGHTLINE_RETURN_IF_ERROR(ScoreFinished(chosen, &result));
    // Only for the report, so it follows the count of evaluations.
    SIGHTLINE_ASSIGN_OR_RETURN(auto fast, gain_model_.FastCoverage(chosen));
    for (size_t i = 0; i < chosen.size(); ++i) {
      result.scans[i].fast_covered = fast[i].covered.Count();
    }
  }
  Report("planned", static_cast<int64_t>(result.scans.size()), result.score.satisfied, true);
  return result;
}

absl::Status PlanRun::ScoreFinished(std::span<const Measurement> scans, PlannerResult* result) {
  const auto total = static_cast<double>(std::max<int64_t>(1, measurable_));
  if (!request_.with_curves) {
    result->coverage_curve.clear();
  } else if (gain_model_.ScoresPlans()) {
    SIGHTLINE_ASSIGN_OR_RETURN(auto growing, gain_model_.ScoreGrowingPlan(scans));
    for (const PlanScore& score : growing) {
      result->coverage_curve.push_back(static_cast<double>(score.satisfied) / total);
      result->relaxed_curve.push_back(static_cast<double>(score.relaxed) / total);
    }
  } else {
    TargetBits covered(gain_model_.measurable().size());
    for (const ChosenScan& scan : result->scans) {
      covered |= scan.exact.covered;
      result->coverage_curve.push_back(static_cast<double>(covered.Count()) / total);
    }
    result->relaxed_curve = result->coverage_curve;
  }
  SIGHTLINE_ASSIGN_OR_RETURN(result->score, Score(scans, true));
  return absl::OkStatus();
}

const char* FeasibilityName(ScanFeasibility feasibility) {
  switch (feasibility) {
    case ScanFeasibility::kFeasible:
      return "feasible";
    case ScanFeasibility::kCollision:
      return "collision";
    case ScanFeasibility::kTravel:
      return "travel longer than the stage";
    case ScanFeasibility::kOutOfBounds:
      return "out of bounds";
    case ScanFeasibility::kUnreachable:
      return "out of the robot's reach";
  }
  return "unknown";
}

}  // namespace sightline
