// SPDX-License-Identifier: Apache-2.0
// `sightline plan --starts`: the best of several searches, in one process or divided among several.
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

// Selects the starts that this process runs. INVALID_ARGUMENT: several starts together with another
// way of planning (`other`: the option's name, empty: none), a seed beyond the largest, and a shard
// of one start, more shards than starts, or shards without `checkpoint`.
absl::StatusOr<Shard> CheckStartsOptions(const StartsOptions& options, int64_t first_seed,
                                         const std::string& checkpoint, const std::string& other);

// Result of a finished search. `plan` is its document, which has numbers that `result` has summed
// up with those of a later search that was given up.
StartResult StartOf(const PlannerResult& result, const v1::Plan& plan,
                    const std::optional<ScanCountBoundResult>& bound);

// The scans of a search with what they cover, exact and as estimated, asked of the session's gain
// model again. Errors of the gain model.
absl::StatusOr<std::vector<ChosenScan>> ScansOfStart(const PlanningSession& session,
                                                     const StartResult& start);

// Puts the searches into the plan, by rising seed.
void SetStarts(const std::vector<StartResult>& starts, v1::Plan& plan);

// A line for the terminal: how many searches reached the goal, with how many scans, and which was
// chosen. Empty for a plan of one.
std::string SummariseStarts(const v1::Plan& plan);

}  // namespace sightline
