#include "planner_client/strategy/greedy_plan.h"

#include "absl/strings/str_cat.h"
#include "planner_client/optimise/random.h"
#include "planner_client/strategy/cover_bits.h"

namespace sightline {

absl::StatusOr<PlannerResult> PlanGreedily(PlanRun& run, const NextBestScans& next_best) {
  const PlannerRequest& request = run.request();
  std::vector<Measurement> movable = request.starting;
  TargetBits covered(run.oracle().measurable().size());
  for (const auto* given : {&request.locked, &request.starting}) {
    auto exact = run.Exact(*given);
    if (!exact.ok()) return exact.status();
    for (const ScanCoverage* coverage : *exact) {
      if (coverage->feasibility == ScanFeasibility::kFeasible) covered |= coverage->covered;
    }
  }
  int failures = 0;
  for (uint64_t search = 0;; ++search) {
    const int64_t scans = static_cast<int64_t>(request.locked.size() + movable.size());
    if (covered.Count() >= run.goal_targets()) {
      return run.Finish(movable, StopReason::kGoalReached);
    }
    if (scans >= request.goal.max_scans) return run.Finish(movable, StopReason::kMaxScans);
    if (run.Stopped()) return run.Finish(movable, run.stopped_reason());
    auto candidates =
        next_best(covered, scans, DeriveSeed(static_cast<uint64_t>(request.seed), search));
    if (run.IsStop(candidates.status())) return run.Finish(movable, run.stopped_reason());
    if (!candidates.ok()) return candidates.status();
    bool found = false;
    for (const Measurement& candidate : *candidates) {
      auto exact = run.Exact({&candidate, 1});
      if (run.IsStop(exact.status())) return run.Finish(movable, run.stopped_reason());
      if (!exact.ok()) return exact.status();
      const ScanCoverage& coverage = *exact->front();
      if (coverage.feasibility != ScanFeasibility::kFeasible ||
          CountOnlyIn(coverage.covered, covered) < run.min_new_targets()) {
        continue;
      }
      movable.push_back(candidate);
      covered |= coverage.covered;
      found = true;
      break;
    }
    failures = found ? 0 : failures + 1;
    if (failures == 2) return run.Finish(movable, StopReason::kStalled);
  }
}

NextBestScans SearchWith(PlanRun& run, const GreedySearch& search) {
  return [&run, search](const TargetBits& covered, int64_t scans,
                        uint64_t seed) -> absl::StatusOr<std::vector<Measurement>> {
    constexpr size_t kCandidates = 4;
    constexpr double kSeparation = 0.01;
    TopPoints top(kCandidates, kSeparation);
    MaximiseOptions options = search.options;
    options.periodic = run.space().periodic();
    auto best =
        Maximise(search.method, run.space().dimension(),
                 run.NewTargets(covered, &top, absl::StrCat("searching scan ", scans + 1), scans),
                 run.request().evaluations_per_scan, seed, options);
    if (!best.ok()) return best.status();
    std::vector<Measurement> result;
    for (const auto& entry : top.entries()) result.push_back(run.space().ToMeasurement(entry.x));
    return result;
  };
}

}  // namespace sightline
