// SPDX-License-Identifier: Apache-2.0
// The table of a plan's scans.
#pragma once

#include <string>

#include "planner_client/report/plan/sections/report_data.h"

namespace sightline {

// A section with a row per scan: picture, nine parameters, travel, and what it measures.
std::string ScansSection(const ReportData& data);

}  // namespace sightline
