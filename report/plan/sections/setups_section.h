// SPDX-License-Identifier: Apache-2.0
// Section on the set-ups of a plan and the pose of the part in each scan.
#pragma once

#include <string>
#include <vector>

#include "report/document/report_parts.h"
#include "sightline/v1/plan.pb.h"

namespace sightline {

// Set-ups in order, excluded faces, the resting faces, and remarks on scans. Empty if the plan has
// none of them. `face_pictures_png`: as in ReportData.
ReportBlocks SetupsBlocks(const v1::Plan& plan, const std::vector<std::string>& face_pictures_png);

}  // namespace sightline
