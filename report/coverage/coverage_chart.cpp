// SPDX-License-Identifier: Apache-2.0
#include "report/coverage/coverage_chart.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "report/document/report_series.h"
#include "report/page/number_text.h"

namespace sightline {
namespace {

// Limit for labels: those of longer plans would cover the line.
constexpr size_t kMostLabels = 25;

}  // namespace

v1::ReportChart CoverageChart(const CoverageCurve& curve) {
  const size_t scans = curve.coverage.size();
  v1::ReportChart chart;
  chart.set_title(curve.title);
  *chart.mutable_x() = AxisOf("scans", "");
  chart.mutable_x()->set_whole_numbers(true);
  chart.mutable_x()->set_low(0);
  chart.mutable_x()->set_high(
      std::max({static_cast<double>(scans), std::ceil(curve.bound_scans), 1.0}) + 0.4);
  *chart.mutable_y() = AxisOf(curve.axis, "%");
  chart.mutable_y()->set_low(0);
  chart.mutable_y()->set_high(100);
  if (scans > 0) {
    *chart.add_series() = SeriesOf("", v1::REPORT_COLOUR_MODEL, v1::ReportSeries::LINE, {0, 1},
                                   {0, 100 * curve.coverage[0]});
  }
  if (!curve.upper.empty()) {
    v1::ReportSeries& upper = *chart.add_series();
    upper =
        EmptySeries(curve.upper_name, v1::REPORT_COLOUR_REFERENCE, v1::ReportSeries::LINE_AND_DOTS);
    for (size_t i = 0; i < curve.upper.size(); ++i) {
      AddPoint(static_cast<double>(i + 1), 100 * curve.upper[i], &upper);
    }
  }
  v1::ReportSeries& measured = *chart.add_series();
  measured =
      EmptySeries(curve.coverage_name, v1::REPORT_COLOUR_MODEL, v1::ReportSeries::LINE_AND_DOTS);
  measured.set_of_scans(true);
  for (size_t i = 0; i < scans; ++i) {
    const double value = 100 * curve.coverage[i];
    const double before = i > 0 ? 100 * curve.coverage[i - 1] : 0;
    AddPoint(static_cast<double>(i + 1), value,
             absl::StrCat("+", FixedNumber(value - before, 2), "\u202f%"), &measured);
    if (scans <= kMostLabels) measured.add_labels(FixedNumber(value, 1));
  }
  if (curve.fresh.has_value() && scans > 0) {
    *chart.add_series() = SeriesOf("after the last scan, on targets that the search has not seen",
                                   v1::REPORT_COLOUR_UNSPECIFIED, v1::ReportSeries::HOLLOW_DOTS,
                                   {static_cast<double>(scans) + 0.2}, {100 * *curve.fresh});
  }
  if (curve.goal > 0) {
    AddLineAtY(100 * curve.goal, &chart, absl::StrFormat("goal %.4g\u202f%%", 100 * curve.goal));
  }
  if (curve.bound_scans > 0) {
    AddLineAtX(
        curve.bound_scans, &chart,
        absl::StrCat(curve.bound_converged ? "lower bound " : "relaxation, not a proven bound: ",
                     FixedNumber(curve.bound_scans, 1), " scans"));
  }
  return chart;
}

}  // namespace sightline
