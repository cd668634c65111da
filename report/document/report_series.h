// SPDX-License-Identifier: Apache-2.0
// Series and lines of the charts of a report.
#pragma once

#include <string>
#include <vector>

#include "sightline/v1/report.pb.h"

namespace sightline {

// A series without points. `name` is its entry in the chart's key; empty: no entry.
v1::ReportSeries EmptySeries(const std::string& name, v1::ReportColour colour,
                             v1::ReportSeries::Mark mark);
// `x` and `y` are of equal length; values that are not finite leave a gap.
v1::ReportSeries SeriesOf(const std::string& name, v1::ReportColour colour,
                          v1::ReportSeries::Mark mark, const std::vector<double>& x,
                          const std::vector<double>& y);

void AddPoint(double x, double y, v1::ReportSeries* series);
// `note` is shown when the reader points at the point.
void AddPoint(double x, double y, const std::string& note, v1::ReportSeries* series);

// Adds a band of y +- `half_widths` around the existing points, named `name` in the key. Does
// nothing without widths.
void AddBand(const std::string& name, const std::vector<double>& half_widths,
             v1::ReportSeries* series);

v1::ReportAxis AxisOf(const std::string& title, const std::string& unit, bool logarithmic = false);

// Adds a horizontal line at a value of y, or a vertical line at a value of x. `name` is its entry
// in the key.
void AddLineAtY(double y, v1::ReportChart* chart, const std::string& name = "");
void AddLineAtX(double x, v1::ReportChart* chart, const std::string& name = "");

}  // namespace sightline
