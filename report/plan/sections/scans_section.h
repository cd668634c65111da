// SPDX-License-Identifier: Apache-2.0
// The table of a plan's scans.
#pragma once

#include "report/document/report_parts.h"
#include "report/plan/sections/report_data.h"

namespace sightline {

// One row per scan: picture, nine parameters, travel, and measured targets.
ReportBlocks ScansBlocks(const ReportData& data);

}  // namespace sightline
