// SPDX-License-Identifier: Apache-2.0
// Sections on what a plan costs: to execute, to compute, and with other strategies.
#pragma once

#include <string>

#include "planner_client/report/plan/sections/report_data.h"
#include "sightline/v1/plan.pb.h"

namespace sightline {

std::string CostSection(const v1::Plan& plan);
std::string TimingSection(const ReportData& data);
std::string ComparisonSection(const ComparisonTable& table);

}  // namespace sightline
