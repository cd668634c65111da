// SPDX-License-Identifier: Apache-2.0
#include "planner_client/report/plan/sections/pareto_section.h"

#include <algorithm>
#include <numeric>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "planner_client/report/charts/xy_chart.h"
#include "planner_client/report/page/assets.h"
#include "planner_client/report/page/number_text.h"
#include "planner_client/report/page/static_page.h"

namespace sightline {
namespace {

constexpr int kFrontWidth_px = 900, kFrontHeight_px = 420;

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

// Most settled within so many seconds, as a stair.
ChartSeries Stair(const v1::ParetoFront& front) {
  std::vector<int> order(static_cast<size_t>(front.points_size()));
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) {
    return Abscissa(front, front.points(a)) < Abscissa(front, front.points(b));
  });
  ChartSeries stair;
  stair.css_class = "model";
  for (const int i : order) {
    const v1::ParetoPoint& point = front.points(i);
    const double y = 100 * point.settled();
    if (!stair.y.empty() && y <= stair.y.back()) continue;
    if (!stair.y.empty()) {
      stair.x.push_back(Abscissa(front, point));
      stair.y.push_back(stair.y.back());
    }
    stair.x.push_back(Abscissa(front, point));
    stair.y.push_back(y);
  }
  return stair;
}

}  // namespace

std::string ParetoChartSvg(const v1::ParetoFront& front) {
  XyChart chart;
  chart.width = kFrontWidth_px;
  chart.height = kFrontHeight_px;
  chart.x.title = front.has_costs() ? "time to execute, s" : "scans";
  chart.x.whole_numbers = !front.has_costs();
  chart.y.title = front.for_uncertainty() ? "admissible, % of the judged surface"
                                          : "measured, % of the measurable surface";
  chart.title = front.has_costs() ? "Satisfied surface against time, by number of scans"
                                  : "Satisfied surface against number of scans";
  if (front.goal() > 0) chart.marks = {100 * front.goal()};
  ChartSeries dominated;
  dominated.css_class = "faint";
  dominated.mark = SeriesMark::kDots;
  for (const v1::ParetoPoint& point : front.dominated()) {
    dominated.x.push_back(Abscissa(front, point));
    dominated.y.push_back(100 * point.settled());
    dominated.notes.push_back(Note(front, point));
  }
  ChartSeries points, chosen;
  points.css_class = "model";
  points.mark = SeriesMark::kDots;
  chosen.css_class = "null";
  chosen.mark = SeriesMark::kRings;
  for (const v1::ParetoPoint& point : front.points()) {
    points.x.push_back(Abscissa(front, point));
    points.y.push_back(100 * point.settled());
    points.notes.push_back(Note(front, point));
    points.labels.push_back(absl::StrCat(point.scans()));
    if (point.number() != front.chosen()) continue;
    chosen.x = {points.x.back()};
    chosen.y = {points.y.back()};
    chosen.notes = {Note(front, point)};
  }
  chart.series = {Stair(front), dominated, points, chosen};
  return XyChartSvg(chart);
}

std::string ParetoSvgFile(const v1::ParetoFront& front) {
  std::string svg = ParetoChartSvg(front);
  const size_t inside = svg.find(">\n") + 2;
  svg.insert(inside, absl::StrCat("<style><![CDATA[", ReportStyle(), ChartStyle(),
                                  "]]></style>\n<rect width=\"100%\" height=\"100%\" "
                                  "style=\"fill: var(--paper)\"/>\n"));
  return "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n" +
         svg.replace(0, 4,
                     absl::StrFormat("<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"%d\" "
                                     "height=\"%d\" style=\"font-family: sans-serif\"",
                                     kFrontWidth_px, kFrontHeight_px));
}

std::string ParetoSection(const v1::ParetoFront& front) {
  std::string body = absl::StrCat(
      "<p>Plans of which none is better than another in all of number of scans",
      front.has_costs() ? ", time" : "",
      " and satisfied surface. What counts as satisfied is the less "
      "of the plan\u2019s own targets and of targets that the search has not seen; all numbers "
      "are exact.</p>\n");
  if (!front.has_costs()) {
    body +=
        "<p class=\"soft\">The inspection states no speeds or times (<code>costs</code>), so "
        "each scan costs 1 and there is no time to trade against.</p>\n";
  }
  if (front.stop_reason() == v1::Plan::STOP_REASON_INTERRUPTED ||
      front.stop_reason() == v1::Plan::STOP_REASON_MAX_TIME) {
    absl::StrAppend(&body, "<p><strong>The front is not finished: ",
                    front.stop_reason() == v1::Plan::STOP_REASON_MAX_TIME ? "the time was up"
                                                                          : "it was interrupted",
                    ".</strong></p>\n");
  }
  std::vector<KeyEntry> key = {
      {"model", KeyShape::kDot, "point of the front, with its number of scans"},
      {"model", KeyShape::kLine,
       front.has_costs() ? "most that was found within so many seconds"
                         : "most that was found with so many scans"},
      {"null", KeyShape::kRing, "the plan of this report"}};
  if (front.dominated_size() > 0) {
    key.push_back({"faint", KeyShape::kDot, "plan to which a point of the front is better"});
  }
  if (front.goal() > 0) {
    key.push_back({"faint", KeyShape::kDashedLine,
                   absl::StrFormat("goal, %.6g\u202f%%", 100 * front.goal())});
  }
  absl::StrAppend(&body, ParetoChartSvg(front), ChartKey(key));
  std::vector<std::string> head = {"point", "scans"};
  if (front.has_costs()) {
    head.insert(head.end(), {"time<br>s", "scanning<br>s", "of it waiting for frames<br>s",
                             "repositioning<br>s"});
  }
  head.push_back(front.for_uncertainty() ? "admissible<br>%" : "measured<br>%");
  head.push_back("own targets");
  const bool fresh = front.fresh_judged_targets() > 0;
  if (fresh) head.push_back("validation targets");
  head.push_back("");
  std::vector<std::vector<std::string>> rows;
  for (const v1::ParetoPoint& point : front.points()) {
    std::vector<std::string> row = {absl::StrCat(point.number()), absl::StrCat(point.scans())};
    if (front.has_costs()) {
      for (const double seconds : {point.time_s(), point.scan_time_s(), point.frame_rate_time_s(),
                                   point.reposition_time_s()}) {
        row.push_back(FixedNumber(seconds, 1));
      }
    }
    row.push_back(absl::StrCat("<strong>", FixedNumber(100 * point.settled(), 2), "</strong>"));
    row.push_back(absl::StrCat(point.settled_targets()));
    if (fresh) row.push_back(absl::StrCat(point.fresh_settled_targets()));
    row.push_back(absl::StrCat(point.reaches_goal() ? "goal" : "",
                               point.number() == front.chosen() ? " \u25c0 this plan" : ""));
    rows.push_back(std::move(row));
  }
  absl::StrAppend(
      &body, PageTable(head, rows, {static_cast<int>(head.size()) - 1}),
      "<p class=\"soft\"><code>sightline plan \u2026 --pick NUMBER</code> with the same "
      "folder writes plan and report of another point, without planning again.</p>\n");
  return PageSection("pareto", "Fewer scans or less time", body);
}

}  // namespace sightline
