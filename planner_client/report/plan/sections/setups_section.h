// SPDX-License-Identifier: Apache-2.0
// How the part lies in each scan, as a section of the report.
#pragma once

#include <string>
#include <vector>

#include "sightline/v1/plan.pb.h"

namespace sightline {

// "lies on face B, turned 37.2°, table 34 mm below the stage axis"; empty for parts that do not
// rest.
std::string SetupText(const v1::Plan& plan, const v1::PlannedScan& scan);

// Table of the resting faces, each with a picture of one of its scans (PNG, may be empty; in the
// order of plan.scans). Remarks on scans follow. Empty if there is neither.
std::string SetupsHtml(const v1::Plan& plan, const std::vector<std::string>& pictures_png);

}  // namespace sightline
