// SPDX-License-Identifier: Apache-2.0
// Uncertainties of targets after scans of several set-ups. They combine the coverage service's
// results, which treat scans as independent, with errors that scans share
// (requirements/joined_scans.h).
#pragma once

#include <cstdint>
#include <span>

#include "absl/status/statusor.h"
#include "core/inspection/inspection.h"
#include "planner_client/coverage_client/coverage_client.h"
#include "planning/requirements/known_targets.h"
#include "planning/requirements/requirements.h"

namespace sightline {

// `scans` are in the order of execution; `uncertainties` are the service's for these scans and
// `targets` (ascending; empty: all). They are replaced by those of the joined scans; the values
// after each scan assume that all scans are joined already. The result covers all targets, without
// knowledge of those that are not in `targets`. Errors of the service. The client's targets must
// outlive the result.
absl::StatusOr<PlanKnowledge> JoinScans(const Inspection& inspection,
                                        const Requirements& requirements, CoverageClient& client,
                                        std::span<const Measurement> scans,
                                        std::span<const uint32_t> targets,
                                        PosteriorUncertainties& uncertainties);

}  // namespace sightline
