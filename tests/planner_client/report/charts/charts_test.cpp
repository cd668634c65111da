// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <limits>
#include <regex>
#include <string>
#include <utility>
#include <vector>

#include "planner_client/report/charts/chart_axis.h"
#include "planner_client/report/charts/coverage_curve.h"
#include "planner_client/report/charts/xy_chart.h"
#include "planner_client/report/recordings/line_range.h"
#include "tests/planner_client/report/well_formed.h"

namespace sightline {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

TEST(ChartScale, PutsTicksAtRoundNumbers) {
  ChartAxis axis;
  axis.low = 0;
  axis.high = 10;
  EXPECT_THAT(ChartScale(axis, {}, 0, 100).Ticks(5), ElementsAre(0, 2, 4, 6, 8, 10));
  axis.logarithmic = true;
  axis.low = 0.9;
  axis.high = 1100;
  EXPECT_THAT(ChartScale(axis, {}, 0, 100).Ticks(4), ElementsAre(1, 10, 100, 1000));
  EXPECT_THAT(ChartScale(axis, {}, 0, 100).Ticks(7), ElementsAre(1, 3, 10, 30, 100, 300, 1000));
}

// Half-way between their mean distance and none at all, labels would run into one another.
TEST(ChartScale, PutsTicksOfItsOwnWhereTheyFit) {
  ChartAxis axis;
  axis.logarithmic = true;
  axis.low = 1;
  axis.high = 16;
  axis.ticks = {0.5, 1, 2, 2.1, 4, 8, 16, 32};
  EXPECT_THAT(ChartScale(axis, {}, 0, 100).Ticks(5), ElementsAre(1, 2, 4, 8, 16));
  EXPECT_THAT(ChartScale(axis, {}, 100, 0).Ticks(1), ElementsAre(1, 4, 16));
}

TEST(ChartScale, MapsLinesAndPowers) {
  ChartAxis axis;
  axis.low = 1;
  axis.high = 100;
  EXPECT_NEAR(ChartScale(axis, {}, 200, 0).At(50.5), 100, 1e-9);
  axis.logarithmic = true;
  EXPECT_NEAR(ChartScale(axis, {}, 200, 0).At(10), 100, 1e-9);
  EXPECT_NEAR(ChartScale(axis, {}, 200, 0).At(-5), 200, 1e-9);  // at the end of the axis
}

TEST(ChartScale, CoversAnyData) {
  for (const bool logarithmic : {false, true}) {
    for (const std::vector<double>& values :
         {std::vector<double>{}, {kNaN}, {3.0}, {0.0}, {-1.0, 2.0}, {1e-12, 1e12}, {5.0, 5.0}}) {
      ChartAxis axis;
      axis.logarithmic = logarithmic;
      const ChartScale scale(axis, values, 0, 100);
      EXPECT_LT(scale.low(), scale.high());
      for (const double value : values) {
        if (!std::isfinite(value) || (logarithmic && value <= 0)) continue;
        EXPECT_TRUE(scale.Shows(value));
      }
      EXPECT_LE(scale.Ticks(6).size(), 20u);
    }
  }
}

TEST(XyChart, LeavesGapsWhereThereIsNoNumber) {
  XyChart chart;
  chart.series = {{"null", SeriesMark::kLineAndDots, {1, 2, 3, 4}, {1, kNaN, 3, 4}, {}, {}}};
  const std::string svg = XyChartSvg(chart);
  EXPECT_EQ(CountOf(svg, "<circle"), 3u);
  const std::smatch::string_type path = svg.substr(svg.find("d=\"M"));
  EXPECT_EQ(CountOf(path.substr(0, path.find('/')), "M"), 2u);
  EXPECT_THAT(svg, Not(HasSubstr("nan")));
}

TEST(XyChart, DrawsNothingBelowZeroOnALogarithmicAxis) {
  XyChart chart;
  chart.y.logarithmic = true;
  chart.series = {{"observed", SeriesMark::kDots, {1, 2, 3}, {-1, 10, 100}, {5, 5, 5}, {}}};
  const std::string svg = XyChartSvg(chart);
  EXPECT_EQ(CountOf(svg, "<circle"), 2u);
  EXPECT_EQ(CountOf(svg, "class=\"band"), 1u);
  EXPECT_THAT(svg, Not(HasSubstr("nan")));
}

TEST(XyChart, LeavesOutPointsBesideTheAxis) {
  XyChart chart;
  chart.x.low = 2;
  chart.x.high = 4;
  chart.series = {{"observed", SeriesMark::kDots, {1, 2, 3, 4, 5}, {900, 1, 2, 3, 900}, {}, {}}};
  const std::string svg = XyChartSvg(chart);
  EXPECT_EQ(CountOf(svg, "<circle"), 3u);
  EXPECT_THAT(svg, Not(HasSubstr(">500<")));  // the others do not stretch the ordinate
}

TEST(XyChart, DrawsBandsThatAreNotSymmetric) {
  XyChart chart;
  chart.height = 244;  // the axis is 190 high
  chart.y.low = 0;
  chart.y.high = 19;
  ChartSeries series{"model", SeriesMark::kLine, {1, 2, 3}, {5, 5, 5}, {}, {}};
  series.lower = {4, 4, kNaN};
  series.upper = {10, 10, 10};
  chart.series = {series};
  const std::string svg = XyChartSvg(chart);
  const std::regex band(
      "class=\"band model\" d=\"M[0-9.]+ ([0-9.]+)L[0-9.]+ [0-9.]+L[0-9.]+ "
      "([0-9.]+)L[0-9.]+ [0-9.]+Z\"");
  std::smatch match;
  ASSERT_TRUE(std::regex_search(svg, match, band)) << svg;
  EXPECT_NEAR(std::stod(match[2]) - std::stod(match[1]), 60, 0.2);
}

TEST(XyChart, MakesRoomForBands) {
  for (const bool logarithmic : {false, true}) {
    XyChart chart;
    chart.y.logarithmic = logarithmic;
    ChartSeries series{"model", SeriesMark::kLine, {1, 2}, {10, 10}, {}, {}};
    series.lower = {9, 9};
    series.upper = {1000, 1000};
    chart.series = {series};
    EXPECT_THAT(XyChartSvg(chart), HasSubstr(">1000<"));
  }
}

TEST(XyChart, LabelsDotsAsFarAsTheyDoNotOverlap) {
  XyChart chart;
  ChartSeries series;
  series.css_class = "model";
  series.mark = SeriesMark::kDots;
  series.x = {0, 0.001, 0.002, 10};
  series.y = {1, 1, 1, 2};
  series.labels = {"above", "below", "hidden", "a < b"};
  chart.series = {series};
  const std::string svg = XyChartSvg(chart);
  EXPECT_THAT(svg, HasSubstr(">above</text>"));
  EXPECT_THAT(svg, HasSubstr(">below</text>"));
  EXPECT_THAT(svg, Not(HasSubstr("hidden")));
  EXPECT_THAT(svg, HasSubstr("a &lt; b"));
}

TEST(XyChart, RingsGoAroundDots) {
  XyChart chart;
  chart.series = {{"null", SeriesMark::kRings, {1}, {1}, {}, {"the best"}}};
  const std::string svg = XyChartSvg(chart);
  EXPECT_EQ(CountOf(svg, "<circle class=\"ring null\""), 1u);
  EXPECT_EQ(CountOf(svg, "<path"), 0u);
  EXPECT_THAT(svg, HasSubstr("<title>the best</title>"));
}

TEST(LineRange, IsTheLineAndAsMuchBesideIt) {
  std::vector<double> rows, line, flat;
  for (int row = 0; row < 256; ++row) {
    rows.push_back(row);
    line.push_back(5 + (std::abs(row - 100) <= 10 ? 400 : 0));
    flat.push_back(5);
  }
  EXPECT_EQ(LineRange(rows, line), std::make_pair(70.0, 130.0));
  EXPECT_EQ(LineRange(rows, flat), std::make_pair(0.0, 255.0));
  line.assign(256, kNaN);
  EXPECT_EQ(LineRange(rows, line), std::make_pair(0.0, 255.0));
  EXPECT_EQ(LineRange({3}, {1}), std::make_pair(3.0, 3.0));
}

TEST(CoverageCurve, BoundLabelStaysInTheDrawing) {
  constexpr double kWidth = 760, kWidestCharacter = 8;  // px of the view box; 13 px type
  const std::regex label(
      "<text class=\"bound-label\" x=\"([-0-9.]+)\" y=\"[-0-9.]+\" "
      "text-anchor=\"(start|end)\">([^<]*)</text>");
  for (const bool converged : {false, true}) {
    for (double bound = 0.5; bound < 24; bound += 0.5) {
      CoverageCurve curve;
      curve.coverage.assign(11, 0.5);
      curve.bound_scans = bound;
      curve.bound_converged = converged;
      const std::string svg = CoverageCurveSvg(curve);
      std::smatch match;
      ASSERT_TRUE(std::regex_search(svg, match, label)) << svg;
      const double anchor = std::stod(match[1]);
      const double length = kWidestCharacter * static_cast<double>(match[3].length());
      const double left = match[2] == "end" ? anchor - length : anchor;
      EXPECT_GE(left, 0) << bound;
      EXPECT_LE(left + length, kWidth) << bound;
    }
  }
}

}  // namespace
}  // namespace sightline
