// SPDX-License-Identifier: Apache-2.0
// Named quantities one below the other, each with its values and intervals, as a drawing.
#pragma once

#include <string>
#include <vector>

#include "planner_client/report/charts/chart_axis.h"

namespace sightline {

struct RangeMark {
  std::string css_class;  // its colour, see charts.css
  double value = 0;
  double half_interval = 0;  // 0: none
};

struct RangeRow {
  std::string label;
  std::vector<RangeMark> marks;  // drawn one above the other in the row
  std::string note;              // right of it
};

struct RangeChart {
  std::string title;  // for those who do not see it
  ChartAxis x;
  std::vector<RangeRow> rows;
  std::vector<double> lines;  // down through all rows
  // A shaded range of x, e.g. what counts as usual; empty if both are equal.
  double shaded_low = 0, shaded_high = 0;
  bool joined = false;  // a line from the first mark of a row to its last, at one height
};

// An <svg> element, coloured by the page's CSS variables.
std::string RangeChartSvg(const RangeChart& chart);

}  // namespace sightline
