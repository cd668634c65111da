// SPDX-License-Identifier: Apache-2.0
// The first part of a plan's report: the answer, its figures, and coverage over scans.
#pragma once

#include <string>

#include "planner_client/report/plan/sections/report_data.h"
#include "sightline/v1/plan.pb.h"

namespace sightline {

// The answer in a sentence or two, as HTML.
std::string FindingHtml(const v1::Plan& plan);

// Entries of a <dl>: number of scans, what they measure, the bound, times.
std::string FiguresHtml(const ReportData& data);

// A section: coverage scan by scan, with goal and bound.
std::string CurveSection(const v1::Plan& plan);

}  // namespace sightline
