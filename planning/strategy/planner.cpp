// SPDX-License-Identifier: Apache-2.0
#include "planning/strategy/planner.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "core/spelling/nearest_name.h"
#include "core/status/status_macros.h"
#include "planning/strategy/greedy_plan.h"
#include "planning/strategy/matrix_plan.h"
#include "planning/strategy/plan_run.h"
#include "planning/strategy/refined_plan.h"

namespace sightline {

namespace {

absl::Status UnknownStrategy(const std::string& name) {
  std::vector<std::string> names;
  for (const StrategyDescription& strategy : Strategies()) names.push_back(strategy.name);
  return absl::InvalidArgumentError(absl::StrCat("strategy: unknown name \"", name,
                                                 "\"; nearest is \"", NearestName(name, names),
                                                 "\"; one of ", absl::StrJoin(names, ", ")));
}

absl::Status CheckRequest(const PlannerRequest& request) {
  const auto bad = [](const char* field, const auto& value, const char* allowed) {
    return absl::InvalidArgumentError(absl::StrCat(field, ": ", value, " is not ", allowed));
  };
  if (!(GoalFraction(request.goal) > 0 && GoalFraction(request.goal) <= 1)) {
    return bad(request.goal.admissible ? "goal.admissible" : "goal.coverage",
               GoalFraction(request.goal), "in (0, 1]");
  }
  if (request.goal.max_scans < 1) return bad("goal.max_scans", request.goal.max_scans, ">= 1");
  if (!(request.goal.min_gain >= 0 && request.goal.min_gain <= 1)) {
    return bad("goal.min_gain", request.goal.min_gain, "in [0, 1]");
  }
  if (request.evaluations_per_scan < 1) {
    return bad("evaluations_per_scan", request.evaluations_per_scan, ">= 1");
  }
  if (request.matrix_samples < 1) return bad("matrix_samples", request.matrix_samples, ">= 1");
  if (request.scan_count) {
    const auto given = static_cast<int64_t>(request.locked.size() + request.starting.size());
    if (*request.scan_count < 1) return bad("scan_count", *request.scan_count, ">= 1");
    if (*request.scan_count < given) {
      return bad("scan_count", *request.scan_count,
                 absl::StrCat("at least the ", given, " locked and starting scans").c_str());
    }
  }
  return absl::OkStatus();
}

// With `scan_count` set, ask for full coverage and at most that many scans.
PlannerRequest AimAtAllTargets(PlannerRequest request) {
  (request.goal.admissible ? *request.goal.admissible : request.goal.coverage) = 1;
  request.goal.max_scans = *request.scan_count;
  request.goal.min_gain = 0;
  return request;
}

using PlanFunction = absl::StatusOr<PlannerResult> (*)(PlanRun&);

struct Strategy {
  StrategyDescription description;
  PlanFunction plan;
};

absl::StatusOr<PlannerResult> PlanWithAnnealing(PlanRun& run) {
  GreedySearch search;
  search.method = Method::kSimulatedAnnealing;
  search.options.step = 0.1;
  // Table 6.1: k_B T_start = 5520 targets, of 19 080.
  search.options.start_temperature =
      5520.0 / 19080.0 * static_cast<double>(std::max<int64_t>(1, run.measurable()));
  return PlanGreedily(run, SearchWith(run, search));
}

template <Method method, int restarts>
absl::StatusOr<PlannerResult> PlanGreedilyBy(PlanRun& run) {
  GreedySearch search;
  search.method = method;
  search.options.restarts = restarts;
  return PlanGreedily(run, SearchWith(run, search));
}

const std::vector<Strategy>& KnownStrategies() {
  static const std::vector<Strategy> strategies = {
      {{"refined", "pool of scans, exchange, continuous polishing, dropping scans", false},
       PlanRefined},
      {{"greedy-pso", "greedy next best scan, particle swarm, five restarts", true},
       PlanGreedilyBy<Method::kParticleSwarm, 5>},
      {{"greedy-pso-1", "greedy next best scan, one long particle swarm", true},
       PlanGreedilyBy<Method::kParticleSwarm, 1>},
      {{"greedy-ga", "greedy next best scan, genetic algorithm", true},
       PlanGreedilyBy<Method::kGeneticAlgorithm, 1>},
      {{"greedy-sa", "greedy next best scan, simulated annealing", true}, PlanWithAnnealing},
      {{"greedy-cmaes", "greedy next best scan, CMA-ES, five restarts", true},
       PlanGreedilyBy<Method::kCmaEs, 5>},
      {{"greedy-de", "greedy next best scan, self-adaptive differential evolution", true},
       PlanGreedilyBy<Method::kDifferentialEvolution, 1>},
      {{kMatrixStrategy, "measurability matrix of random scans, lazy greedy choice", true},
       PlanWithMatrix},
  };
  return strategies;
}

}  // namespace

double GoalFraction(const PlanningGoal& goal) { return goal.admissible.value_or(goal.coverage); }

const std::vector<StrategyDescription>& Strategies() {
  static const std::vector<StrategyDescription> descriptions = [] {
    std::vector<StrategyDescription> all;
    for (const Strategy& strategy : KnownStrategies()) all.push_back(strategy.description);
    return all;
  }();
  return descriptions;
}

absl::Status CheckStrategy(const std::string& name) {
  const bool known = std::any_of(Strategies().begin(), Strategies().end(),
                                 [&](const auto& strategy) { return strategy.name == name; });
  return known ? absl::OkStatus() : UnknownStrategy(name);
}

absl::StatusOr<PlannerResult> MakePlan(GainModel& gain_model, const PlannerRequest& given) {
  SIGHTLINE_RETURN_IF_ERROR(CheckStrategy(given.strategy));
  SIGHTLINE_RETURN_IF_ERROR(CheckRequest(given));
  const PlannerRequest request = given.scan_count ? AimAtAllTargets(given) : given;

  PlanRun run(gain_model, request);
  SIGHTLINE_ASSIGN_OR_RETURN(auto locked, run.Exact(request.locked));
  for (size_t i = 0; i < locked.size(); ++i) {
    if (locked[i]->feasibility != ScanFeasibility::kFeasible) {
      return absl::InvalidArgumentError(
          absl::StrCat("locked scan ", i + 1, ": ", FeasibilityName(locked[i]->feasibility)));
    }
  }

  const auto& known = KnownStrategies();
  return std::find_if(known.begin(), known.end(),
                      [&](const Strategy& s) { return s.description.name == request.strategy; })
      ->plan(run);
}

}  // namespace sightline
