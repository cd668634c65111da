// SPDX-License-Identifier: Apache-2.0
// Text, cells and facts for the numbers of a plan's report.
#pragma once

#include <cstdint>
#include <string>

#include "absl/strings/string_view.h"
#include "report/document/report_parts.h"
#include "sightline/v1/plan.pb.h"

namespace sightline {

std::string Percent(double fraction, int decimals = 1);

// The goal with as many decimals as stated: "95 %", "97.5 %".
std::string GoalText(double fraction);

// Length in millimetres, without the unit.
std::string Millimetres(double length_m, int decimals = 1);

// "3.21 s", "14 min 02 s".
std::string SecondsText(double seconds);

// "1 scan", "17 scans".
std::string CountText(int64_t count, absl::string_view noun);

// A number in the unit of its column with `decimals` decimals.
v1::ReportCell FixedCell(double value, int decimals);
// A length in millimetres, in a column of this unit.
v1::ReportCell MillimetreCell(double length_m, int decimals = 1);
// A fraction in per cent; a dash if it is not finite.
v1::ReportCell PercentCell(double fraction, int decimals = 1);

v1::ReportFact SecondsFact(const std::string& name, double seconds);
v1::ReportFact PercentFact(const std::string& name, double fraction, int decimals = 1,
                           const std::string& detail = "");

// Selecting the row shows this object in the scene. Positions count from 0.
void ShowScan(int scan, v1::ReportRow* row);
void ShowUnmeasuredRegion(int region, v1::ReportRow* row);
void ShowFeature(int feature, v1::ReportRow* row);

// Reason why the search ended: "the goal was reached".
std::string StopWords(v1::Plan::StopReason reason);

bool GoalReached(const v1::PlanCoverage& coverage);

}  // namespace sightline
