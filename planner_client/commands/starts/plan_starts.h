// SPDX-License-Identifier: Apache-2.0
// `sightline plan --starts`: the best of several searches, in one or several processes.
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "planner_client/commands/planning/session/planning_session.h"
#include "planner_client/commands/shard.h"
#include "planning/multi_start/start_result.h"
#include "planning/strategy/planner.h"
#include "sightline/v1/plan.pb.h"

namespace sightline {

struct StartsOptions {
  int count = 1;
  std::string part;

  bool Several() const { return count > 1; }
};

void AddStartsOptions(CLI::App& app, StartsOptions* options);

// Selects the starts that this process runs. INVALID_ARGUMENT for several starts with another
// planning mode (`other`: name of the option, or empty), a seed beyond the largest, shards of a
// single start, more shards than starts, or shards without `checkpoint`.
absl::StatusOr<Shard> CheckStartsOptions(const StartsOptions& options, int64_t first_seed,
                                         const std::string& checkpoint, const std::string& other);

// Result of a finished search. `plan` is its document: it has numbers that `result` contains only
// as sums with those of a later, abandoned search.
StartResult StartOf(const PlannerResult& result, const v1::Plan& plan,
                    const std::optional<ScanCountBoundResult>& bound);

// The scans of a search with their exact and estimated coverage, evaluated again by the session's
// gain model. Errors of the gain model.
absl::StatusOr<std::vector<ChosenScan>> ScansOfStart(const PlanningSession& session,
                                                     const StartResult& start);

// Stores the searches in the plan, by ascending seed.
void SetStarts(const std::vector<StartResult>& starts, v1::Plan& plan);

// A line for the terminal: number of searches that reached the goal, their numbers of scans, and
// the chosen one. Empty for a single search.
std::string SummariseStarts(const v1::Plan& plan);

}  // namespace sightline
