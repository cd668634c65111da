// SPDX-License-Identifier: Apache-2.0
#include "planner_client/commands/starts/plan_starts.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/status/status_macros.h"
#include "planner_client/commands/planning/document/plan_document.h"

namespace sightline {

void AddStartsOptions(CLI::App& app, StartsOptions* options) {
  app.add_option(
         "--starts", options->count,
         "plan with so many seeds, from --seed on, and keep the plan that costs least to execute; "
         "ties: fewer scans, then more satisfied targets, then the lower seed")
      ->check(CLI::Range(1, 1000));
  app.add_option("--part", options->part,
                 "K/N: run shard K of N of the starts, each as a process of its own with the same "
                 "--checkpoint, on any machine; then the same command without --part chooses the "
                 "best and writes --out");
}

absl::StatusOr<Shard> CheckStartsOptions(const StartsOptions& options, int64_t first_seed,
                                         const std::string& checkpoint, const std::string& other) {
  SIGHTLINE_ASSIGN_OR_RETURN(auto part, ParseShard(options.part, checkpoint));
  if (part.count > options.count) {
    return absl::InvalidArgumentError(
        absl::StrFormat("--part %s: there are %d starts (--starts), so at most as many shards",
                        options.part, options.count));
  }
  if (!options.Several()) return part;
  if (!other.empty()) {
    return absl::InvalidArgumentError(absl::StrCat("--starts and ", other, " exclude each other"));
  }
  if (first_seed > std::numeric_limits<int64_t>::max() - (options.count - 1)) {
    return absl::InvalidArgumentError(
        absl::StrFormat("--seed %d: with --starts %d must be at most %d", first_seed, options.count,
                        std::numeric_limits<int64_t>::max() - (options.count - 1)));
  }
  return part;
}

StartResult StartOf(const PlannerResult& result, const v1::Plan& plan,
                    const std::optional<ScanCountBoundResult>& bound) {
  StartResult start;
  start.seed = plan.seed();
  start.stop_reason = result.stop_reason;
  start.evaluations = plan.gain_evaluations();
  start.satisfied = static_cast<double>(result.score.Claimed()) /
                    static_cast<double>(std::max<int64_t>(1, result.score.measurable));
  start.cost = plan.cost().total();
  for (const ChosenScan& scan : result.scans) {
    start.scans.push_back({scan.measurement, scan.locked});
  }
  start.bound = bound;
  if (start.bound) start.bound->generated_columns.clear();
  return start;
}

absl::StatusOr<std::vector<ChosenScan>> ScansOfStart(const PlanningSession& session,
                                                     const StartResult& start) {
  std::vector<Measurement> measurements;
  for (const StartResult::Scan& scan : start.scans) measurements.push_back(scan.measurement);
  std::vector<ChosenScan> scans;
  if (measurements.empty()) return scans;
  SIGHTLINE_ASSIGN_OR_RETURN(auto exact, session.gain_model->ExactCoverage(measurements));
  SIGHTLINE_ASSIGN_OR_RETURN(auto fast, session.gain_model->FastCoverage(measurements));
  for (size_t i = 0; i < measurements.size(); ++i) {
    scans.push_back({.measurement = measurements[i],
                     .locked = start.scans[i].locked,
                     .exact = std::move(exact[i]),
                     .fast_covered = fast[i].covered.Count()});
  }
  return scans;
}

void SetStarts(const std::vector<StartResult>& starts, v1::Plan& plan) {
  for (const StartResult& start : starts) {
    v1::PlanStart& message = *plan.add_starts();
    message.set_seed(start.seed);
    message.set_scans(static_cast<int>(start.scans.size()));
    message.set_settled(start.satisfied);
    message.set_stop_reason(StopReasonToProto(start.stop_reason));
    message.set_gain_evaluations(start.evaluations);
    message.set_cost(start.cost);
  }
}

std::string SummariseStarts(const v1::Plan& plan) {
  if (plan.starts_size() < 2) return "";
  int reached = 0;
  int fewest = std::numeric_limits<int>::max();
  int most = 0;
  for (const v1::PlanStart& start : plan.starts()) {
    if (start.stop_reason() != v1::Plan::STOP_REASON_GOAL_REACHED) continue;
    ++reached;
    fewest = std::min(fewest, start.scans());
    most = std::max(most, start.scans());
  }
  const std::string scans = reached == 0 ? ""
                            : fewest == most
                                ? absl::StrFormat(" with %d scans", most)
                                : absl::StrFormat(" with %d to %d scans", fewest, most);
  return absl::StrFormat("%d of %d starts reached the goal%s; the best is that of seed %d.\n",
                         reached, plan.starts_size(), scans, plan.seed());
}

}  // namespace sightline
