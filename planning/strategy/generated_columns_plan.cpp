// SPDX-License-Identifier: Apache-2.0
#include "planning/strategy/generated_columns_plan.h"

#include <utility>
#include <vector>

#include "core/status/status_macros.h"

namespace sightline {

absl::StatusOr<PlannerResult> PlanWithGeneratedColumns(GainModel& gain_model,
                                                       const PlannerRequest& request,
                                                       PlannerResult plan,
                                                       const ScanCountBoundResult& bound) {
  if (request.strategy != "refined" || request.scan_count ||
      plan.stop_reason != StopReason::kGoalReached ||
      (bound.converged && bound.scans >= static_cast<int>(plan.scans.size()))) {
    return plan;
  }
  PlannerRequest again = request;
  again.locked.clear();
  again.starting.clear();
  for (const ChosenScan& scan : plan.scans) {
    (scan.locked ? again.locked : again.starting).push_back(scan.measurement);
  }
  for (const std::vector<Measurement>* found :
       {&bound.generated_columns, &std::as_const(plan).candidates}) {
    again.candidates.insert(again.candidates.end(), found->begin(), found->end());
  }
  SIGHTLINE_ASSIGN_OR_RETURN(auto better, MakePlan(gain_model, again));
  const int64_t evaluations = plan.evaluations + better.evaluations;
  if (better.stop_reason == StopReason::kGoalReached && better.scans.size() < plan.scans.size()) {
    plan = std::move(better);
  }
  plan.evaluations = evaluations;
  return plan;
}

}  // namespace sightline
