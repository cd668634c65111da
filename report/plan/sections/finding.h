// SPDX-License-Identifier: Apache-2.0
// The first part of a plan's report: the answer, its figures, and coverage over scans.
#pragma once

#include <vector>

#include "report/document/report_parts.h"
#include "report/plan/sections/report_data.h"
#include "sightline/v1/plan.pb.h"

namespace sightline {

// The answer in a sentence or two.
std::vector<v1::ReportRun> PlanFinding(const v1::Plan& plan);

// Number of scans, what they measure, the bound, times.
std::vector<v1::ReportFact> PlanFigures(const ReportData& data);

// Coverage scan by scan, with goal and bound.
ReportBlocks CurveBlocks(const v1::Plan& plan);

}  // namespace sightline
