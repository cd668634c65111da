// SPDX-License-Identifier: Apache-2.0
// Planning strategies: which scans satisfy the targets of the part.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/inspection/inspection.h"
#include "planning/strategy/execution/execution_model.h"
#include "planning/strategy/gain_model.h"

namespace sightline {

enum class StopReason {
  kGoalReached,
  kMaxScans,
  kMaxTime,
  kStalled,
  kInterrupted,
  kExecutionLimit,  // PlanningGoal::LimitsExecution
};

struct ChosenScan {
  Measurement measurement;
  bool locked = false;       // given by the engineer; never moved or dropped
  ScanCoverage exact;        // exact coverage of this scan alone
  int64_t fast_covered = 0;  // fast estimate of exact.covered.Count()
};

struct PlanProgress {
  int scans;
  double coverage;  // satisfied targets, fraction of those to be satisfied
  double goal;
  int64_t evaluations;
  double done;        // fraction of the work: as the coverage, except where that says little
  std::string phase;  // "searching scan 4", "polishing", "dropping a scan", ...
};

struct PlannerRequest {
  MeasurementDomain domain;
  PlanningGoal goal;
  std::string strategy = "refined";
  int64_t seed = 1;
  // Gain evaluations per scan for greedy strategies. The refined strategy may use as many in total
  // as greedy planning for the same number of scans.
  int64_t evaluations_per_scan = 10000;
  int64_t matrix_samples = 200000;    // measurability matrix only
  std::vector<Measurement> locked;    // kept in the plan, first
  std::vector<Measurement> starting;  // resumed or hand-edited scans: in the plan, may be moved
  // If set: satisfy as many targets as possible with this number of scans, regardless of the goal's
  // fraction, number of scans and least gain. At least 1 and at least the number of locked and
  // starting scans.
  std::optional<int> scan_count;
  // Scans known to be good, which the refined strategy may use without searching them.
  std::vector<Measurement> candidates;
  // The refined strategy stops at a plan that reaches the goal and that exchanges of scans alone
  // cannot shorten. For use before another search with better candidates.
  bool draft = false;
  // Cost of executing a plan, for the plan of least time (execution/least_time_plan.h).
  ExecutionModel execution;
  // Estimate of the time of one scan [s]; empty: 0.
  std::function<double(const Measurement&)> scan_time_s;
  // Also score the plan after each scan (PlannerResult's curves). This costs seconds if only whole
  // plans can be scored.
  bool with_curves = true;
  std::function<void(const PlanProgress&)> on_progress;
  const std::atomic<bool>* interrupted = nullptr;  // set by Ctrl-C
};

struct PlannerResult {
  std::vector<ChosenScan> scans;
  StopReason stop_reason = StopReason::kStalled;
  int64_t evaluations = 0;
  // Only with_curves. Exact: satisfied and nearly satisfied targets after each scan, as fractions
  // of those to be satisfied. For coverage both are the coverage.
  std::vector<double> coverage_curve;
  std::vector<double> relaxed_curve;
  PlanScore score;  // of the whole plan
  // Good scans that the refined strategy found, used or not; input of PlannerRequest::candidates.
  std::vector<Measurement> candidates;
};

// The fraction of targets to satisfy: goal.admissible if it is set, else goal.coverage.
double GoalFraction(const PlanningGoal& goal);

// The strategy that samples a measurability matrix.
inline constexpr char kMatrixStrategy[] = "matrix";

// Names and one-line descriptions for --strategy and `sightline compare`.
struct StrategyDescription {
  std::string name;
  std::string description;
  // True if its plan for a lower goal is the beginning of the plan for a higher one.
  bool scan_by_scan;
};
const std::vector<StrategyDescription>& Strategies();

// INVALID_ARGUMENT for an unknown name; the message suggests the nearest known one.
absl::Status CheckStrategy(const std::string& name);

// INVALID_ARGUMENT for an unknown strategy (the message suggests the nearest) or a locked scan
// outside its hard limits. Errors of the gain model are passed on. If interrupted, returns the plan
// so far.
absl::StatusOr<PlannerResult> MakePlan(GainModel& gain_model, const PlannerRequest& request);

}  // namespace sightline
