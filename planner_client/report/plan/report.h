// SPDX-License-Identifier: Apache-2.0
// The report of a plan: one HTML file that needs nothing else, not even a network.
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "planner_client/report/plan/sections/report_data.h"

namespace sightline {

// The page as UTF-8 HTML; the same data give the same bytes. All texts are escaped. Errors of
// CheckReportData.
absl::StatusOr<std::string> RenderReport(const ReportData& data);

}  // namespace sightline
