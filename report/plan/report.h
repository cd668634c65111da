// SPDX-License-Identifier: Apache-2.0
// The report of a plan as data (report.proto).
#pragma once

#include "absl/status/statusor.h"
#include "report/plan/sections/report_data.h"
#include "sightline/v1/report.pb.h"

namespace sightline {

// The same data give the same report. INVALID_ARGUMENT as CheckReportData; INTERNAL: a picture of
// deviations cannot be encoded.
absl::StatusOr<v1::Report> PlanReport(const ReportData& data);

}  // namespace sightline
