// SPDX-License-Identifier: Apache-2.0
#include "planner_client/report/plan/sections/pareto_section.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/planner_client/report/well_formed.h"

namespace sightline {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

v1::ParetoFront Front() {
  v1::ParetoFront front;
  front.mutable_costs()->set_stage_speed_m_per_s(0.1);
  front.set_goal(0.95);
  front.set_chosen(2);
  front.set_judged_targets(1000);
  front.set_fresh_judged_targets(1000);
  const double seconds[] = {10, 24, 20}, settled[] = {0.4, 0.96, 0.7};
  for (int i = 0; i < 3; ++i) {
    v1::ParetoPoint& point = *front.add_points();
    point.set_number(i + 1);
    point.set_scans(i + 1);
    point.set_time_s(seconds[i]);
    point.set_settled(settled[i]);
    point.set_settled_targets(static_cast<int64_t>(1000 * settled[i]));
    point.set_fresh_settled_targets(point.settled_targets());
    point.set_reaches_goal(settled[i] > 0.95);
  }
  v1::ParetoPoint& other = *front.add_dominated();
  other.set_scans(3);
  other.set_time_s(30);
  other.set_settled(0.6);
  return front;
}

TEST(ParetoSection, ShowsEveryPointTheChosenOneAndDominatedPlans) {
  const std::string svg = ParetoChartSvg(Front());
  EXPECT_EQ(CountOf(svg, "class=\"dot model\""), 3u);
  EXPECT_EQ(CountOf(svg, "class=\"ring null\""), 1u);
  EXPECT_EQ(CountOf(svg, "class=\"dot faint\""), 1u);
  EXPECT_EQ(CountOf(svg, "class=\"mark\""), 1u);  // the goal
  EXPECT_THAT(svg, HasSubstr("point 2: 2 scans, 24.0 s, 96.00 %"));
  EXPECT_THAT(svg, HasSubstr("time to execute, s"));
  for (const char* label : {">1</text>", ">2</text>", ">3</text>"})
    EXPECT_THAT(svg, HasSubstr(label));
}

TEST(ParetoSection, IsWellFormedAndListsThePoints) {
  const std::string html = ParetoSection(Front());
  EXPECT_EQ(MarkupFault("<html>" + html + "</html>"), "");
  EXPECT_THAT(html, HasSubstr("this plan"));
  EXPECT_THAT(html, HasSubstr("<strong>96.00</strong>"));
  EXPECT_THAT(html, HasSubstr("--pick"));
  EXPECT_THAT(html, Not(HasSubstr("not finished")));
}

TEST(ParetoSection, WithoutCostsSaysThatThereIsNoTime) {
  v1::ParetoFront front = Front();
  front.clear_costs();
  const std::string html = ParetoSection(front);
  EXPECT_THAT(html, HasSubstr("each scan costs 1"));
  EXPECT_THAT(html, Not(HasSubstr("repositioning")));
  EXPECT_THAT(ParetoChartSvg(front), Not(HasSubstr("time to execute")));
}

TEST(ParetoSection, SaysWhenTheFrontIsNotFinished) {
  v1::ParetoFront front = Front();
  front.set_stop_reason(v1::Plan::STOP_REASON_INTERRUPTED);
  EXPECT_THAT(ParetoSection(front), HasSubstr("not finished: it was interrupted"));
}

TEST(ParetoSection, ThePictureIsAFileOfItsOwn) {
  const std::string svg = ParetoSvgFile(Front());
  EXPECT_EQ(svg.rfind("<?xml", 0), 0u);
  EXPECT_THAT(svg, HasSubstr("<svg xmlns=\"http://www.w3.org/2000/svg\""));
  EXPECT_EQ(CountOf(svg, "<svg"), 1u);
  EXPECT_THAT(svg, HasSubstr("--paper"));
  EXPECT_EQ(ParetoSvgFile(Front()), svg);
}

TEST(ParetoSection, AFrontOfOnePointAndEqualTimesCanBeDrawn) {
  v1::ParetoFront front = Front();
  front.mutable_points()->DeleteSubrange(1, 2);
  front.clear_dominated();
  EXPECT_EQ(MarkupFault("<html>" + ParetoSection(front) + "</html>"), "");
}

}  // namespace
}  // namespace sightline
