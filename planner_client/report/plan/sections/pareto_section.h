// SPDX-License-Identifier: Apache-2.0
// The trade-off between scans, seconds and satisfied surface, as a drawing and a section of the
// report.
#pragma once

#include <string>

#include "sightline/v1/pareto.pb.h"

namespace sightline {

// An <svg> element: satisfied surface over seconds (over scans if the front has no costs), points
// labelled by their number of scans, dominated plans faint, the chosen point in a ring.
std::string ParetoChartSvg(const v1::ParetoFront& front);

// The same drawing as a file of its own.
std::string ParetoSvgFile(const v1::ParetoFront& front);

// Drawing, table of the points and how to take another one; needs the style of charts.
std::string ParetoSection(const v1::ParetoFront& front);

}  // namespace sightline
