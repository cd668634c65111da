// SPDX-License-Identifier: Apache-2.0
#include "planning/strategy/greedy_plan.h"

#include "absl/strings/str_cat.h"
#include "core/random/random.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

// Exact scores of whole plans take seconds. They are computed only if the estimate exceeds this
// fraction of the goal.
constexpr double kNearGoal = 0.97;

}  // namespace

absl::StatusOr<PlannerResult> PlanGreedily(PlanRun& run, const NextBestScans& next_best) {
  const PlannerRequest& request = run.request();
  std::vector<Measurement> movable = request.starting;
  std::vector<Measurement> feasible;  // of all scans so far
  std::vector<float> known = run.NothingKnown();
  for (const auto* given : {&request.locked, &request.starting}) {
    SIGHTLINE_ASSIGN_OR_RETURN(auto exact, run.Exact(*given));
    for (size_t i = 0; i < given->size(); ++i) {
      if (exact[i]->feasibility != ScanFeasibility::kFeasible) continue;
      SIGHTLINE_ASSIGN_OR_RETURN(auto shares, run.SharesOf((*given)[i]));
      AddShares(shares, known);
      feasible.push_back((*given)[i]);
    }
  }
  int failures = 0;
  bool changed = true;
  for (uint64_t search = 0;; ++search) {
    const int64_t scans = static_cast<int64_t>(request.locked.size() + movable.size());
    const double goal = static_cast<double>(run.goal_targets());
    if (changed && static_cast<double>(run.CountSatisfied(known)) >= kNearGoal * goal) {
      auto score = run.Score(feasible, true);
      if (run.IsStop(score.status())) return run.Finish(movable, run.stopped_reason());
      if (!score.ok()) return score.status();
      if (run.ReachesGoal(*score)) return run.Finish(movable, StopReason::kGoalReached);
    }
    changed = false;
    if (scans >= request.goal.max_scans) return run.Finish(movable, StopReason::kMaxScans);
    if (run.Stopped()) return run.Finish(movable, run.stopped_reason());
    auto candidates =
        next_best(known, scans, DeriveSeed(static_cast<uint64_t>(request.seed), search));
    if (run.IsStop(candidates.status())) return run.Finish(movable, run.stopped_reason());
    if (!candidates.ok()) return candidates.status();
    for (const Measurement& candidate : *candidates) {
      auto exact = run.Exact({&candidate, 1});
      if (run.IsStop(exact.status())) return run.Finish(movable, run.stopped_reason());
      if (!exact.ok()) return exact.status();
      if (exact->front()->feasibility != ScanFeasibility::kFeasible) continue;
      auto shares = run.SharesOf(candidate);
      if (run.IsStop(shares.status())) return run.Finish(movable, run.stopped_reason());
      if (!shares.ok()) return shares.status();
      auto added = run.Added(known, candidate, *shares);
      if (run.IsStop(added.status())) return run.Finish(movable, run.stopped_reason());
      if (!added.ok()) return added.status();
      if (*added < run.min_gain()) continue;
      movable.push_back(candidate);
      feasible.push_back(candidate);
      AddShares(*shares, known);
      changed = true;
      break;
    }
    failures = changed ? 0 : failures + 1;
    if (failures == 2) return run.Finish(movable, StopReason::kStalled);
  }
}

NextBestScans SearchWith(PlanRun& run, const GreedySearch& search) {
  return [&run, search](const std::vector<float>& known, int64_t scans,
                        uint64_t seed) -> absl::StatusOr<std::vector<Measurement>> {
    constexpr size_t kCandidates = 4;
    constexpr double kSeparation = 0.01;
    TopPoints top(kCandidates, kSeparation);
    MaximiseOptions options = search.options;
    options.periodic = run.space().periodic();
    SIGHTLINE_RETURN_IF_ERROR(
        Maximise(search.method, run.space().dimension(),
                 run.Gain(known, &top, absl::StrCat("searching scan ", scans + 1), scans),
                 run.request().evaluations_per_scan, seed, options)
            .status());
    std::vector<Measurement> result;
    for (const auto& entry : top.entries()) result.push_back(run.space().ToMeasurement(entry.x));
    return result;
  };
}

}  // namespace sightline
