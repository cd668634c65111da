// SPDX-License-Identifier: Apache-2.0
// Verdicts on a plan's ability to prove that each toleranced feature conforms.
#pragma once

#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "core/conformance/conformance.h"
#include "core/inspection/inspection.h"
#include "core/surface_inference/surface_inference.h"
#include "core/targets/target_set.h"
#include "planning/requirements/known_targets.h"
#include "planning/requirements/requirements.h"
#include "sightline/v1/plan.pb.h"

namespace sightline {

// Returns one verdict per feature, then one per unbound tolerance, in their order
// (core/conformance). The verdict is NOT_EVALUATED with a reason if nothing is fitted to the
// feature's surfaces or if one of them holds too few targets.
std::vector<v1::FeatureVerdict> JudgeFeatures(const Inspection& inspection,
                                              const Requirements& requirements,
                                              const PlanKnowledge& knowledge);

v1::ToleranceCounts CountVerdicts(std::span<const v1::FeatureVerdict> verdicts);

}  // namespace sightline
