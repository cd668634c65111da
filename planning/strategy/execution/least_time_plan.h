// SPDX-License-Identifier: Apache-2.0
// A plan that a person carries out in the least time, from a plan of few scans.
//
// A plan of few scans has a place of the sensors for nearly every scan, and each place takes a
// person minutes and a calibration. Here places are shared: a place of the sensors is scanned from
// with the part on several faces and in several turns.
//
// 1. Pool. Places of the sensors are those of the plan and of good scans of earlier searches. Every
//    place is tried with every way in which the plan's scans have the part. From the places whose
//    scans satisfy most together, further scans are searched that complement one another.
// 2. Choice. The plan of least time out of the pool (setup_choice.h).
// 3. Polishing. Scans move with their place of the sensors fixed; a place moves with all its scans.
//    What that finds goes into the pool, and 2 follows again.
// 4. Exact evaluation. A plan counts if it satisfies the goal exactly, or as much as the first plan
//    if that did not reach the goal.
#pragma once

#include <span>

#include "absl/status/statusor.h"
#include "planning/strategy/planner.h"

namespace sightline {

// True if set-ups cost time, or the goal limits execution.
bool WantsLeastTime(const PlannerRequest& request);

// `plan` is of `request`; `candidates` are further scans known to be good. The result satisfies the
// goal, or as much as `plan`, with at most one scan more than `plan`. Where the goal limits set-ups
// or time, it keeps these limits, may have as many scans as goal.max_scans, and stop_reason is
// kExecutionLimit if it satisfies less than the goal: without any scan where the limits do not
// even allow the first one. Locked scans stay, even where they break a
// limit. `plan` itself where nothing takes less time. Evaluations are the sum of both, about
// `kLeastTimeShare` of the first search's more. Errors of the gain model.
absl::StatusOr<PlannerResult> PlanInLeastTime(GainModel& gain_model, const PlannerRequest& request,
                                              PlannerResult plan,
                                              std::span<const Measurement> candidates);

// Fraction of the evaluations that a greedy search may use for as many scans as the plan has.
inline constexpr double kLeastTimeShare = 0.3;

}  // namespace sightline
