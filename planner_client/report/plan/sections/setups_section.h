// SPDX-License-Identifier: Apache-2.0
// Set-ups of a plan, and how the part lies in each scan.
#pragma once

#include <string>
#include <vector>

#include "planner_client/report/document/report_parts.h"
#include "sightline/v1/plan.pb.h"

namespace sightline {

// Set-ups in order, excluded faces, the resting faces, each with a picture of one of its scans
// (PNG, may be empty; in the order of plan.scans), and remarks on scans. Empty without all of them.
ReportBlocks SetupsBlocks(const v1::Plan& plan, const std::vector<std::string>& pictures_png);

}  // namespace sightline
