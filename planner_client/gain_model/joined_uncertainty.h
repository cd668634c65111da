// SPDX-License-Identifier: Apache-2.0
// Uncertainties of targets after scans of several set-ups: the coverage service's, which knows each
// scan alone, with the errors that scans share (requirements/joined_scans.h).
#pragma once

#include <cstdint>
#include <span>

#include "absl/status/statusor.h"
#include "core/inspection/inspection.h"
#include "planner_client/coverage_client/coverage_client.h"
#include "planning/requirements/known_targets.h"
#include "planning/requirements/requirements.h"

namespace sightline {

// `scans` are in the order in which they are made, `uncertainties` the service's for these scans,
// of `targets` (ascending; empty: all). They become those of the joined scans; uncertainties after
// each scan are as if all scans were joined already. The result holds what is known of all targets,
// of those that are not asked for nothing. Errors of the service. The client's targets must outlive
// the result.
absl::StatusOr<PlanKnowledge> JoinScans(const Inspection& inspection,
                                        const Requirements& requirements, CoverageClient& client,
                                        std::span<const Measurement> scans,
                                        std::span<const uint32_t> targets,
                                        PosteriorUncertainties& uncertainties);

}  // namespace sightline
