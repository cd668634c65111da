// SPDX-License-Identifier: Apache-2.0
#include "planning/pareto/pareto_json.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "core/json/strict_json.h"
#include "tests/planning/analytic_gain_model.h"

namespace sightline {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

ParetoTask FrontTask() {
  ParetoTask task;
  task.inspection_name = "plate";
  task.sightline_version = "1";
  task.part_digest.hex = std::string(64, 'a');
  task.part_file = "plate.stl";
  task.scene_digest = "bb";
  task.costs.stage_speed_m_per_s = 0.1;
  task.costs.reposition_speed_rad_per_s = 0.4;
  task.domain = NineParameterDomain();
  task.goal = 0.95;
  task.judged_targets = 100;
  task.fresh_judged_targets = 50;
  return task;
}

ParetoPoint FrontPoint(int scans, double seconds, int64_t satisfied, int64_t fresh) {
  ParetoPoint point;
  for (int i = 0; i < scans; ++i) {
    ChosenScan scan;
    scan.measurement.offset_y_m = 0.1 * i;
    scan.measurement.part_gamma_rad = 0.7;
    scan.locked = i == 0;
    point.scans.push_back(scan);
  }
  point.time.scan_s = seconds;
  point.time.frame_rate_s = 0.25 * seconds;
  point.time.reposition_s = 2.0 * (scans - 1);
  point.score.satisfied = satisfied;
  point.score.measurable = 100;
  point.score.validation_satisfied = fresh;
  point.score.validation_measurable = 50;
  point.reaches_goal = point.Claimed() >= 95;
  return point;
}

v1::ParetoFront Front() {
  ParetoResult result;
  result.front.points = {FrontPoint(1, 5, 40, 20), FrontPoint(2, 9, 70, 35),
                         FrontPoint(3, 8, 70, 35), FrontPoint(3, 20, 97, 48)};
  result.front.dominated = {FrontPoint(3, 30, 60, 30)};
  result.evaluations = 1234;
  return ParetoToProto(result, FrontTask(), 7, 3, v1::Plan::STOP_REASON_GOAL_REACHED);
}

ParetoPick Number(int number) {
  ParetoPick pick;
  pick.number = number;
  return pick;
}
ParetoPick Scans(int scans) {
  ParetoPick pick;
  pick.scans = scans;
  return pick;
}
ParetoPick Seconds(double seconds) {
  ParetoPick pick;
  pick.seconds = seconds;
  return pick;
}

std::string Error(const absl::Status& status) { return std::string(status.message()); }

TEST(ParetoJsonTest, ComesBackFromTextAsItWas) {
  const v1::ParetoFront front = Front();
  v1::ParetoFront read;
  const absl::Status parsed = ParseStrictJson(ToJson(front), "pareto.json", &read);
  ASSERT_TRUE(parsed.ok()) << parsed;
  EXPECT_EQ(read.SerializeAsString(), front.SerializeAsString());
  EXPECT_EQ(ToJson(read), ToJson(front));
  EXPECT_TRUE(CheckPareto(read, FrontTask(), "pareto.json").ok());
  const std::vector<Measurement> scans = ScansOfPoint(read.points(2));
  ASSERT_EQ(scans.size(), 3u);
  EXPECT_DOUBLE_EQ(scans[2].offset_y_m, 0.2);
  EXPECT_NEAR(scans[2].part_gamma_rad, 0.7, 1e-14);
}

TEST(ParetoJsonTest, HasTheNumbersOfThePoints) {
  const v1::ParetoFront front = Front();
  EXPECT_EQ(front.seed(), 7);
  EXPECT_EQ(front.chosen(), 4);
  EXPECT_EQ(front.gain_evaluations(), 1234);
  ASSERT_EQ(front.points_size(), 4);
  const v1::ParetoPoint& point = front.points(1);
  EXPECT_EQ(point.number(), 2);
  EXPECT_EQ(point.scans(), 2);
  EXPECT_DOUBLE_EQ(point.time_s(), 11);
  EXPECT_DOUBLE_EQ(point.frame_rate_time_s(), 2.25);
  EXPECT_DOUBLE_EQ(point.settled(), 0.7);
  EXPECT_EQ(point.locked_scans(), 1);
  EXPECT_FALSE(point.reaches_goal());
  // 48 of 50 validation targets are 96 %.
  EXPECT_DOUBLE_EQ(front.points(3).settled(), 0.96);
  EXPECT_TRUE(front.points(3).reaches_goal());
  ASSERT_EQ(front.dominated_size(), 1);
  EXPECT_EQ(front.dominated(0).number(), 0);
  EXPECT_EQ(front.dominated(0).measurements_size(), 0);
}

TEST(ParetoJsonTest, FrontsOfAnotherPartOrInspectionAreRefusedByFileAndField) {
  const v1::ParetoFront front = Front();
  ParetoTask task = FrontTask();
  task.part_digest.hex = std::string(64, 'c');
  EXPECT_THAT(Error(CheckPareto(front, task, "d/pareto.json")),
              AllOf(HasSubstr("d/pareto.json: part_digest"), HasSubstr("another part"),
                    HasSubstr(std::string(64, 'a')), HasSubstr(task.part_digest.Text()),
                    Not(HasSubstr("--other-part"))));
  task = FrontTask();
  task.scene_digest = "cc";
  EXPECT_THAT(Error(CheckPareto(front, task, "d/pareto.json")), HasSubstr("scene_digest"));
  task = FrontTask();
  task.costs.stage_speed_m_per_s = 0.2;
  EXPECT_THAT(Error(CheckPareto(front, task, "d/pareto.json")),
              HasSubstr("costs.stage_speed_m_per_s is 0.1, must be 0.2"));
  task = FrontTask();
  task.costs.frame_rate_hz = 50;
  EXPECT_THAT(Error(CheckPareto(front, task, "d/pareto.json")),
              HasSubstr("costs.frame_rate_hz is not given"));
  task = FrontTask();
  task.for_uncertainty = true;
  EXPECT_THAT(Error(CheckPareto(front, task, "d/pareto.json")), HasSubstr("goal.admissible"));
  task = FrontTask();
  task.judged_targets = 99;
  EXPECT_THAT(Error(CheckPareto(front, task, "d/pareto.json")), HasSubstr("judged_targets"));
  task = FrontTask();
  task.domain.parameters[7].ranges = {{-0.05, 0.05}};
  // The first scan is locked: it need not be in the domain.
  EXPECT_THAT(Error(CheckPareto(front, task, "d/pareto.json")),
              HasSubstr("points[1].measurements[1].offset_y_m is 0.1"));
}

// Its digests differ from those of the same part by the rule of today.
TEST(ParetoJsonTest, AFrontOfAnOlderRuleIsTakenWithARemark) {
  v1::ParetoFront front = Front();
  front.set_part_digest(std::string(64, 'e'));
  front.set_scene_digest("another");
  std::string remark;
  const absl::Status taken = CheckPareto(front, FrontTask(), "d/pareto.json", &remark);
  EXPECT_TRUE(taken.ok()) << taken;
  EXPECT_THAT(remark, AllOf(HasSubstr("pareto.json"), HasSubstr("rule 1"), HasSubstr("plate.stl")));
  EXPECT_TRUE(CheckPareto(Front(), FrontTask(), "d/pareto.json", &remark).ok());
  EXPECT_EQ(remark, "");
  ParetoTask task = FrontTask();
  task.judged_targets = 99;
  EXPECT_THAT(Error(CheckPareto(front, task, "d/pareto.json")), HasSubstr("judged_targets"));
}

TEST(ParetoJsonTest, DamagedFrontsAreRefused) {
  v1::ParetoFront front = Front();
  front.mutable_points(1)->set_number(5);
  EXPECT_THAT(Error(CheckPareto(front, FrontTask(), "p")), HasSubstr("points[1].number is 5"));
  front = Front();
  front.mutable_points(1)->clear_measurements();
  EXPECT_THAT(Error(CheckPareto(front, FrontTask(), "p")), HasSubstr("points[1].scans"));
  front = Front();
  front.mutable_points(0)->set_locked_scans(2);
  EXPECT_THAT(Error(CheckPareto(front, FrontTask(), "p")), HasSubstr("points[0].locked_scans"));
  front = Front();
  front.mutable_points(0)->set_settled(1.5);
  EXPECT_THAT(Error(CheckPareto(front, FrontTask(), "p")), HasSubstr("points[0].settled"));
  front = Front();
  front.mutable_points(0)->set_time_s(-1);
  EXPECT_THAT(Error(CheckPareto(front, FrontTask(), "p")), HasSubstr("points[0].time_s"));
  for (const double goal : {0.0, -1.0, 1.5, std::nan("")}) {
    front = Front();
    front.set_goal(goal);
    EXPECT_THAT(Error(CheckPareto(front, FrontTask(), "p")), HasSubstr("goal is ")) << goal;
  }
  front = Front();
  while (front.points(1).measurements_size() <= 1000) {
    *front.mutable_points(1)->add_measurements() = front.points(1).measurements(0);
  }
  front.mutable_points(1)->set_scans(front.points(1).measurements_size());
  EXPECT_THAT(Error(CheckPareto(front, FrontTask(), "p")), HasSubstr("and in [1, 1000]"));
  front = Front();
  front.clear_points();
  EXPECT_THAT(Error(CheckPareto(front, FrontTask(), "p")), HasSubstr("points is empty"));
  EXPECT_THAT(Error(PickPoint(front, Number(1), "p").status()), HasSubstr("points is empty"));
}

TEST(ParetoJsonTest, PicksByNumberScansAndSeconds) {
  const v1::ParetoFront front = Front();  // 5, 11, 12 and 24 s
  EXPECT_EQ(*PickPoint(front, Number(2), "p"), 1);
  EXPECT_EQ(*PickPoint(front, Scans(1), "p"), 0);
  EXPECT_EQ(*PickPoint(front, Scans(2), "p"), 1);
  EXPECT_EQ(*PickPoint(front, Scans(10), "p"), 3);
  EXPECT_EQ(*PickPoint(front, Seconds(5), "p"), 0);
  EXPECT_EQ(*PickPoint(front, Seconds(23), "p"), 1);  // of equally satisfied ones fewer scans
  EXPECT_EQ(*PickPoint(front, Seconds(100), "p"), 3);
}

TEST(ParetoJsonTest, APickBesideTheFrontSaysWhatThereIs) {
  v1::ParetoFront front = Front();
  EXPECT_THAT(Error(PickPoint(front, Number(5), "p").status()), HasSubstr("points 1 to 4"));
  EXPECT_THAT(Error(PickPoint(front, Number(0), "p").status()), HasSubstr("points 1 to 4"));
  EXPECT_THAT(Error(PickPoint(front, Scans(0), "p").status()), HasSubstr("is 1 scan"));
  EXPECT_THAT(Error(PickPoint(front, Seconds(4), "p").status()), HasSubstr("takes 5.00 s"));
  front.clear_costs();
  EXPECT_THAT(Error(PickPoint(front, Seconds(4), "p").status()), HasSubstr("no `costs`"));
}

TEST(ParetoJsonTest, NumbersThatExactEvaluationDoesNotGiveAreRefused) {
  const v1::ParetoFront front = Front();
  const ParetoPoint point = FrontPoint(2, 9, 70, 35);
  EXPECT_TRUE(CheckSameNumbers(front.points(1), point.score, point.time, "p").ok());
  PlanScore score = point.score;
  score.satisfied = 69;
  EXPECT_THAT(Error(CheckSameNumbers(front.points(1), score, point.time, "p")),
              HasSubstr("points[1].settled_targets is 70, must be 69"));
  score = point.score;
  score.validation_satisfied = 36;
  EXPECT_THAT(Error(CheckSameNumbers(front.points(1), score, point.time, "p")),
              HasSubstr("points[1].fresh_settled_targets"));
  PlanTime time = point.time;
  time.scan_s += 1;
  EXPECT_THAT(Error(CheckSameNumbers(front.points(1), point.score, time, "p")),
              HasSubstr("points[1].time_s is 11, must be 12"));
}

TEST(ParetoJsonTest, TheSummaryHasALineForEveryPoint) {
  const std::string text = SummarisePareto(Front());
  EXPECT_THAT(text, HasSubstr("4 points"));
  EXPECT_THAT(text, HasSubstr("*    4     3      24.0   96.00 % goal"));
}

}  // namespace
}  // namespace sightline
