// SPDX-License-Identifier: Apache-2.0
#include "report/document/report_series.h"

#include <cassert>

namespace sightline {
namespace {

void AddLineAcross(v1::ReportLine::Along along, double at, const std::string& name,
                   v1::ReportChart* chart) {
  v1::ReportLine& line = *chart->add_lines();
  line.set_along(along);
  line.set_at(at);
  line.set_name(name);
}

}  // namespace

v1::ReportSeries EmptySeries(const std::string& name, v1::ReportColour colour,
                             v1::ReportSeries::Mark mark) {
  v1::ReportSeries series;
  series.set_name(name);
  series.set_colour(colour);
  series.set_mark(mark);
  return series;
}

v1::ReportSeries SeriesOf(const std::string& name, v1::ReportColour colour,
                          v1::ReportSeries::Mark mark, const std::vector<double>& x,
                          const std::vector<double>& y) {
  assert(x.size() == y.size());
  v1::ReportSeries series = EmptySeries(name, colour, mark);
  series.mutable_x()->Assign(x.begin(), x.end());
  series.mutable_y()->Assign(y.begin(), y.end());
  return series;
}

void AddPoint(double x, double y, v1::ReportSeries* series) {
  series->add_x(x);
  series->add_y(y);
}

void AddPoint(double x, double y, const std::string& note, v1::ReportSeries* series) {
  AddPoint(x, y, series);
  series->add_notes(note);
}

void AddBand(const std::string& name, const std::vector<double>& half_widths,
             v1::ReportSeries* series) {
  if (half_widths.empty()) return;
  assert(static_cast<int>(half_widths.size()) == series->y_size());
  series->set_band_name(name);
  for (int i = 0; i < series->y_size(); ++i) {
    series->add_low(series->y(i) - half_widths[static_cast<size_t>(i)]);
    series->add_high(series->y(i) + half_widths[static_cast<size_t>(i)]);
  }
}

v1::ReportAxis AxisOf(const std::string& title, const std::string& unit, bool logarithmic) {
  v1::ReportAxis axis;
  axis.set_title(title);
  axis.set_unit(unit);
  axis.set_logarithmic(logarithmic);
  return axis;
}

void AddLineAtY(double y, v1::ReportChart* chart, const std::string& name) {
  AddLineAcross(v1::ReportLine::X, y, name, chart);
}

void AddLineAtX(double x, v1::ReportChart* chart, const std::string& name) {
  AddLineAcross(v1::ReportLine::Y, x, name, chart);
}

}  // namespace sightline
