// SPDX-License-Identifier: Apache-2.0
// Lines and dots over an abscissa as a drawing.
#pragma once

#include <string>
#include <vector>

#include "planner_client/report/charts/chart_axis.h"

namespace sightline {

// kRings go around dots of another series.
enum class SeriesMark { kLine, kDashedLine, kDots, kHollowDots, kLineAndDots, kRings };

struct ChartSeries {
  std::string css_class;  // its colour, see charts.css
  SeriesMark mark = SeriesMark::kLine;
  std::vector<double> x, y;        // of equal length; values that are not finite leave a gap
  std::vector<double> half_band;   // drawn as y +- half_band; empty: none
  std::vector<std::string> notes;  // shown on pointing at a dot; empty: none
  // Ends of a band that is not symmetric, instead of half_band; empty: none.
  std::vector<double> lower = {}, upper = {};
  // By the dots, as far as they overlap neither a dot nor an earlier label; empty: none.
  std::vector<std::string> labels = {};
};

struct XyChart {
  std::string title;                // also for those who do not see it
  ChartAxis x, y;                   // points beside a given range of x are left out
  std::vector<ChartSeries> series;  // the first is drawn first
  std::vector<double> marks;        // lines across at these y
  bool hide_x_labels = false;       // the chart below has the same abscissa
  int width = 520, height = 280;    // of the drawing; it grows and shrinks with the page
};

// An <svg> element, coloured by the page's CSS variables.
std::string XyChartSvg(const XyChart& chart);

}  // namespace sightline
