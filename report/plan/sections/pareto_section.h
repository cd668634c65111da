// SPDX-License-Identifier: Apache-2.0
// The trade-off between scans, seconds and satisfied surface.
#pragma once

#include "report/document/report_parts.h"
#include "sightline/v1/pareto.pb.h"

namespace sightline {

// Satisfied surface over seconds (over scans if the front has no costs): points labelled by their
// number of scans, dominated plans faint, the chosen point in a ring.
v1::ReportChart ParetoChart(const v1::ParetoFront& front);

// Chart, table of the points and instructions to choose another one.
ReportBlocks ParetoBlocks(const v1::ParetoFront& front);

}  // namespace sightline
