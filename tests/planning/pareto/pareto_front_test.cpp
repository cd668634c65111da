// SPDX-License-Identifier: Apache-2.0
#include "planning/pareto/pareto_front.h"

#include <gtest/gtest.h>

#include <vector>

#include "core/random/random.h"

namespace sightline {
namespace {

ParetoPoint Point(int scans, double seconds, int64_t satisfied, bool goal = false) {
  ParetoPoint point;
  point.scans.resize(static_cast<size_t>(scans));
  point.time.scan_s = seconds;
  point.score.satisfied = satisfied;
  point.score.measurable = 100;
  point.reaches_goal = goal;
  return point;
}

TEST(ParetoFrontTest, APointDominatesWhatIsNowhereBetter) {
  EXPECT_TRUE(Dominates(Point(2, 10, 50), Point(3, 10, 50)));
  EXPECT_TRUE(Dominates(Point(2, 10, 50), Point(2, 11, 50)));
  EXPECT_TRUE(Dominates(Point(2, 10, 50), Point(2, 10, 49)));
  EXPECT_FALSE(Dominates(Point(2, 10, 50), Point(2, 10, 50)));
  EXPECT_FALSE(Dominates(Point(2, 10, 50), Point(1, 20, 40)));
  EXPECT_FALSE(Dominates(Point(1, 20, 40), Point(2, 10, 50)));
}

TEST(ParetoFrontTest, WhatCountsIsWhatAPlanCanClaim) {
  // As good on its own targets, worse on validation targets.
  ParetoPoint a = Point(2, 10, 50), b = Point(2, 10, 50);
  a.score.validation_measurable = b.score.validation_measurable = 100;
  a.score.validation_satisfied = 50;
  b.score.validation_satisfied = 40;
  EXPECT_TRUE(Dominates(a, b));
}

TEST(ParetoFrontTest, NoPointOfAFrontDominatesAnotherAndEveryOtherIsDominated) {
  Random random(3);
  std::vector<ParetoPoint> found;
  for (int i = 0; i < 300; ++i) {
    found.push_back(Point(static_cast<int>(random.Below(8)), static_cast<double>(random.Below(30)),
                          random.Below(40)));
  }
  const size_t count = found.size();
  const ParetoFront front = FrontOf(found);
  ASSERT_FALSE(front.points.empty());
  ASSERT_FALSE(front.dominated.empty());
  EXPECT_LT(front.points.size() + front.dominated.size(),
            count);  // no plans without scans, no equals
  for (size_t i = 0; i < front.points.size(); ++i) {
    EXPECT_FALSE(front.points[i].scans.empty());
    for (size_t j = 0; j < front.points.size(); ++j) {
      EXPECT_FALSE(Dominates(front.points[i], front.points[j]));
    }
  }
  for (const ParetoPoint& other : front.dominated) {
    bool dominated = false;
    for (const ParetoPoint& point : front.points) dominated |= Dominates(point, other);
    EXPECT_TRUE(dominated);
  }
  // Every plan found is a point or is matched by one.
  for (const ParetoPoint& plan : found) {
    if (plan.scans.empty()) continue;
    bool matched = false;
    for (const ParetoPoint& point : front.points) {
      matched |= point.scans.size() <= plan.scans.size() &&
                 point.time.Total_s() <= plan.time.Total_s() && point.Claimed() >= plan.Claimed();
    }
    EXPECT_TRUE(matched);
  }
}

TEST(ParetoFrontTest, ComesByScansThenSeconds) {
  const ParetoFront front =
      FrontOf({Point(3, 5, 60), Point(2, 9, 50), Point(2, 7, 40), Point(2, 9, 50)});
  ASSERT_EQ(front.points.size(), 3u);
  EXPECT_EQ(front.points[0].Claimed(), 40);
  EXPECT_EQ(front.points[1].Claimed(), 50);
  EXPECT_EQ(front.points[2].Claimed(), 60);
  EXPECT_TRUE(front.dominated.empty());
}

TEST(ParetoFrontTest, TheGoalTakesTheFewestScansThenTheLeastTimeElseTheMostSettled) {
  EXPECT_EQ(PointForGoal({}), std::nullopt);
  EXPECT_EQ(PointForGoal({Point(1, 5, 60), Point(2, 9, 80), Point(3, 9, 70)}), 1u);
  EXPECT_EQ(PointForGoal({Point(1, 5, 60), Point(2, 9, 90, true), Point(2, 8, 89, true),
                          Point(3, 7, 95, true)}),
            2u);
}

TEST(ParetoFrontTest, NothingFoundIsAnEmptyFront) {
  EXPECT_TRUE(FrontOf({}).points.empty());
  EXPECT_TRUE(FrontOf({Point(0, 0, 0)}).points.empty());
}

}  // namespace
}  // namespace sightline
