// SPDX-License-Identifier: Apache-2.0
#include "report/plan/sections/pareto_section.h"

#include <algorithm>
#include <numeric>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "report/document/report_series.h"
#include "report/page/number_text.h"

namespace sightline {
namespace {

double Abscissa(const v1::ParetoFront& front, const v1::ParetoPoint& point) {
  return front.has_costs() ? point.time_s() : point.scans();
}

std::string Note(const v1::ParetoFront& front, const v1::ParetoPoint& point) {
  std::string note = absl::StrCat(
      point.number() > 0 ? absl::StrCat("point ", point.number(), ": ") : "dominated: ",
      point.scans(), point.scans() == 1 ? " scan, " : " scans, ");
  if (front.has_costs()) absl::StrAppend(&note, FixedNumber(point.time_s(), 1), " s, ");
  return absl::StrCat(note, FixedNumber(100 * point.settled(), 2), " %");
}

// Largest satisfied fraction within a number of seconds, as a step curve.
v1::ReportSeries Stair(const v1::ParetoFront& front) {
  std::vector<int> order(static_cast<size_t>(front.points_size()));
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) {
    return Abscissa(front, front.points(a)) < Abscissa(front, front.points(b));
  });
  v1::ReportSeries stair =
      EmptySeries(front.has_costs() ? "most that was found within so many seconds"
                                    : "most that was found with so many scans",
                  v1::REPORT_COLOUR_MODEL, v1::ReportSeries::LINE);
  for (const int i : order) {
    const v1::ParetoPoint& point = front.points(i);
    const double y = 100 * point.settled();
    if (stair.y_size() > 0) {
      const double last = stair.y(stair.y_size() - 1);
      if (y <= last) continue;
      AddPoint(Abscissa(front, point), last, &stair);
    }
    AddPoint(Abscissa(front, point), y, &stair);
  }
  return stair;
}

ReportCells RowOf(const v1::ParetoFront& front, const v1::ParetoPoint& point) {
  ReportCells row = {CountCell(point.number()), CountCell(point.scans())};
  if (front.has_costs()) {
    for (const double seconds : {point.time_s(), point.scan_time_s(), point.frame_rate_time_s(),
                                 point.reposition_time_s()}) {
      row.push_back(NumberCell(seconds, FixedNumber(seconds, 1)));
    }
  }
  v1::ReportCell satisfied =
      NumberCell(100 * point.settled(), FixedNumber(100 * point.settled(), 2));
  satisfied.set_strong(true);
  row.push_back(satisfied);
  row.push_back(CountCell(point.settled_targets()));
  if (front.fresh_judged_targets() > 0) row.push_back(CountCell(point.fresh_settled_targets()));
  row.push_back(
      TextCell(absl::StrCat(point.reaches_goal() ? "goal" : "",
                            point.number() == front.chosen() ? " \u25c0 this plan" : "")));
  return row;
}

v1::ReportBlock PointTable(const v1::ParetoFront& front) {
  std::vector<v1::ReportColumn> columns = {NumberColumn("point"), NumberColumn("scans")};
  if (front.has_costs()) {
    for (const char* name : {"time", "scanning", "of it waiting for frames", "repositioning"}) {
      columns.push_back(NumberColumn(name, "s"));
    }
  }
  columns.push_back(NumberColumn(front.for_uncertainty() ? "admissible" : "measured", "%"));
  columns.push_back(NumberColumn("own targets"));
  if (front.fresh_judged_targets() > 0) columns.push_back(NumberColumn("validation targets"));
  columns.push_back(WordsColumn("remark"));
  std::vector<ReportCells> rows;
  for (const v1::ParetoPoint& point : front.points()) rows.push_back(RowOf(front, point));
  return TableBlock("Points of the front", columns, rows);
}

}  // namespace

v1::ReportChart ParetoChart(const v1::ParetoFront& front) {
  v1::ReportChart chart;
  *chart.mutable_x() = front.has_costs() ? AxisOf("time to execute", "s") : AxisOf("scans", "");
  chart.mutable_x()->set_whole_numbers(!front.has_costs());
  *chart.mutable_y() = AxisOf(front.for_uncertainty() ? "admissible, of the toleranced surface"
                                                      : "measured, of the measurable surface",
                              "%");
  chart.set_title(front.has_costs() ? "Satisfied surface against time, by number of scans"
                                    : "Satisfied surface against number of scans");
  if (front.goal() > 0) {
    AddLineAtY(100 * front.goal(), &chart,
               absl::StrFormat("goal, %.6g\u202f%%", 100 * front.goal()));
  }
  v1::ReportSeries dominated = EmptySeries("plan to which a point of the front is better",
                                           v1::REPORT_COLOUR_FAINT, v1::ReportSeries::DOTS);
  for (const v1::ParetoPoint& point : front.dominated()) {
    AddPoint(Abscissa(front, point), 100 * point.settled(), Note(front, point), &dominated);
  }
  v1::ReportSeries points = EmptySeries("point of the front, with its number of scans",
                                        v1::REPORT_COLOUR_MODEL, v1::ReportSeries::DOTS);
  v1::ReportSeries chosen =
      EmptySeries("the plan of this report", v1::REPORT_COLOUR_REFERENCE, v1::ReportSeries::RINGS);
  for (const v1::ParetoPoint& point : front.points()) {
    AddPoint(Abscissa(front, point), 100 * point.settled(), Note(front, point), &points);
    points.add_labels(absl::StrCat(point.scans()));
    if (point.number() != front.chosen()) continue;
    AddPoint(Abscissa(front, point), 100 * point.settled(), Note(front, point), &chosen);
  }
  *chart.add_series() = Stair(front);
  for (const v1::ReportSeries& series : {dominated, points, chosen}) {
    if (series.x_size() > 0) *chart.add_series() = series;
  }
  return chart;
}

ReportBlocks ParetoBlocks(const v1::ParetoFront& front) {
  ReportBlocks blocks = {TextBlock(absl::StrCat(
      "Plans of which none is better than another in all of number of scans",
      front.has_costs() ? ", time" : "",
      " and satisfied surface. What counts as satisfied is the less of the plan\u2019s own targets "
      "and of targets that the search has not seen; all numbers are exact."))};
  if (!front.has_costs()) {
    blocks.push_back(RemarkBlock(
        "The inspection states no speeds or times (costs), so each scan costs 1 and there is no "
        "time to trade against."));
  }
  if (front.stop_reason() == v1::Plan::STOP_REASON_INTERRUPTED ||
      front.stop_reason() == v1::Plan::STOP_REASON_MAX_TIME) {
    blocks.push_back(ParagraphBlock({StrongRun(
        absl::StrCat("The front is not finished: ",
                     front.stop_reason() == v1::Plan::STOP_REASON_MAX_TIME ? "the time was up"
                                                                           : "it was interrupted",
                     "."))}));
  }
  blocks.push_back(ChartBlock(ParetoChart(front)));
  blocks.push_back(PointTable(front));
  v1::ReportBlock remark = ParagraphBlock(
      {CodeRun("sightline plan \u2026 --pick NUMBER"),
       PlainRun(" with the same folder writes plan and report of another point, without planning "
                "again.")});
  remark.mutable_paragraph()->set_remark(true);
  blocks.push_back(remark);
  return blocks;
}

}  // namespace sightline
