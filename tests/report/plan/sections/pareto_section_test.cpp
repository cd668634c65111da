// SPDX-License-Identifier: Apache-2.0
#include "report/plan/sections/pareto_section.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/report/report_reading.h"

namespace sightline {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

v1::ParetoFront Front() {
  v1::ParetoFront front;
  front.mutable_costs()->set_stage_speed_m_per_s(0.1);
  front.set_goal(0.95);
  front.set_chosen(2);
  front.set_judged_targets(1000);
  front.set_fresh_judged_targets(1000);
  const double seconds[] = {10, 24, 20}, satisfied[] = {0.4, 0.96, 0.7};
  for (int i = 0; i < 3; ++i) {
    v1::ParetoPoint& point = *front.add_points();
    point.set_number(i + 1);
    point.set_scans(i + 1);
    point.set_time_s(seconds[i]);
    point.set_settled(satisfied[i]);
    point.set_settled_targets(static_cast<int64_t>(1000 * satisfied[i]));
    point.set_fresh_settled_targets(point.settled_targets());
    point.set_reaches_goal(satisfied[i] > 0.95);
  }
  v1::ParetoPoint& other = *front.add_dominated();
  other.set_scans(3);
  other.set_time_s(30);
  other.set_settled(0.6);
  return front;
}

v1::Report ReportOf(const v1::ParetoFront& front) {
  v1::Report report;
  report.set_title("front");
  report.set_kind("plan");
  AddSection(&report, "pareto", "Front", ParetoBlocks(front));
  EXPECT_EQ(ReportFault(report), "");
  return report;
}

TEST(ParetoSection, ShowsEveryPointTheChosenOneAndDominatedPlans) {
  const v1::ReportChart chart = ParetoChart(Front());
  EXPECT_EQ(PointsOf(chart, v1::REPORT_COLOUR_MODEL, v1::ReportSeries::DOTS), 3);
  EXPECT_EQ(PointsOf(chart, v1::REPORT_COLOUR_REFERENCE, v1::ReportSeries::RINGS), 1);
  EXPECT_EQ(PointsOf(chart, v1::REPORT_COLOUR_FAINT, v1::ReportSeries::DOTS), 1);
  ASSERT_EQ(chart.lines_size(), 1);
  EXPECT_DOUBLE_EQ(chart.lines(0).at(), 95);  // the goal
  EXPECT_EQ(chart.x().title(), "time to execute");
  EXPECT_EQ(chart.x().unit(), "s");
  // The stair rises to 40, 70 and 96 % at 10, 20 and 24 s.
  const v1::ReportSeries& stair = chart.series(0);
  EXPECT_THAT(stair.x(), ElementsAre(10, 20, 20, 24, 24));
  EXPECT_THAT(stair.y(), ElementsAre(40, 40, 70, 70, 96));
}

TEST(ParetoSection, ListsThePoints) {
  const v1::Report report = ReportOf(Front());
  const v1::ReportTable table = FirstTableOf(report, "pareto");
  EXPECT_EQ(CellOf(table, "2", "measured").text(), "96.00");
  EXPECT_TRUE(CellOf(table, "2", "measured").strong());
  EXPECT_EQ(CellOf(table, "2", "time").number(), 24);
  EXPECT_THAT(CellOf(table, "2", "remark").text(), HasSubstr("this plan"));
  EXPECT_THAT(TextOf(report), AllOf(HasSubstr("--pick"), Not(HasSubstr("not finished")),
                                    HasSubstr("point 2: 2 scans, 24.0 s, 96.00 %")));
}

TEST(ParetoSection, WithoutCostsSaysThatThereIsNoTime) {
  v1::ParetoFront front = Front();
  front.clear_costs();
  EXPECT_THAT(TextOf(ReportOf(front)),
              AllOf(HasSubstr("each scan costs 1"), Not(HasSubstr("repositioning")),
                    Not(HasSubstr("time to execute"))));
}

TEST(ParetoSection, SaysWhenTheFrontIsNotFinished) {
  v1::ParetoFront front = Front();
  front.set_stop_reason(v1::Plan::STOP_REASON_INTERRUPTED);
  EXPECT_THAT(TextOf(ReportOf(front)), HasSubstr("not finished: it was interrupted"));
}

TEST(ParetoSection, AFrontOfOnePointHasNoDominatedSeries) {
  v1::ParetoFront front = Front();
  front.mutable_points()->DeleteSubrange(1, 2);
  front.clear_dominated();
  EXPECT_EQ(ChartsOf(ReportOf(front)).at(0).series_size(), 2);
}

}  // namespace
}  // namespace sightline
