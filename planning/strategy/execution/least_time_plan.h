// SPDX-License-Identifier: Apache-2.0
// A plan that a person carries out in the least time, from a plan of few scans.
//
// A plan of few scans has another place of the sensors for nearly every scan. Each place costs a
// person minutes and a calibration. This search shares places: from one place of the sensors the
// part is scanned on several faces and in several turns.
//
// 1. Pool. Places of the sensors come from the plan and from good scans of earlier searches. Each
//    place is combined with every pose of the part in the plan's scans. From the places whose
//    scans together satisfy most, further scans are searched that complement one another.
// 2. Choice. The plan of least time from the pool (setup_choice.h).
// 3. Polishing. Scans move with their place of the sensors fixed; a place moves with all its scans.
//    The results enter the pool, and step 2 is repeated.
// 4. Exact evaluation. A plan is accepted if it satisfies the goal exactly, or as much as the first
//    plan if that one does not reach the goal.
#pragma once

#include <span>

#include "absl/status/statusor.h"
#include "planning/strategy/planner.h"

namespace sightline {

// True if set-ups cost time, or the goal limits execution.
bool WantsLeastTime(const PlannerRequest& request);

// `plan` is the result of `request`; `candidates` are further scans known to be good. The result
// satisfies the goal, or as much as `plan`, with at most one scan more than `plan`. If the goal
// limits set-ups or time, the result keeps these limits and may have goal.max_scans scans. If it
// then satisfies less than the goal, stop_reason is kExecutionLimit; it has no scan if the limits
// exclude even the first one. Locked scans stay, even if they exceed a limit. Returns `plan` if
// nothing takes less time. Evaluations are the sum of both searches; this one uses about
// `kLeastTimeShare` of those of the first. Errors of the gain model.
absl::StatusOr<PlannerResult> PlanInLeastTime(GainModel& gain_model, const PlannerRequest& request,
                                              PlannerResult plan,
                                              std::span<const Measurement> candidates);

// Fraction of the evaluations that a greedy search may use for as many scans as the plan has.
inline constexpr double kLeastTimeShare = 0.3;

}  // namespace sightline
