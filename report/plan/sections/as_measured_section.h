// SPDX-License-Identifier: Apache-2.0
// Section of a plan's report on the deviations of a measured part.
#pragma once

#include <span>

#include "absl/status/statusor.h"
#include "report/document/report_parts.h"
#include "report/plan/sections/report_data.h"
#include "sightline/v1/plan.pb.h"

namespace sightline {

// Pose with uncertainty, degrees of freedom that the points leave open, deviations as a histogram
// and on the part, and changes of the plan. `scans`: of the plan. `for_uncertainty`: satisfied
// targets have an admissible uncertainty; otherwise they are covered. Errors as DeviationViews.
absl::StatusOr<ReportBlocks> AsMeasuredBlocks(const v1::AsMeasured& found, int scans,
                                              bool for_uncertainty,
                                              std::span<const ReportDeviation> deviations);

}  // namespace sightline
