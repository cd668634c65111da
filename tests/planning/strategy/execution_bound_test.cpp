// SPDX-License-Identifier: Apache-2.0
#include "planning/strategy/execution/execution_bound.h"

#include <gtest/gtest.h>

#include <vector>

namespace sightline {
namespace {

TargetBits All(size_t count) {
  TargetBits bits(count);
  for (size_t t = 0; t < count; ++t) bits.Set(t);
  return bits;
}

TEST(BoundFaces, IsOneWithoutFaces) {
  EXPECT_EQ(BoundFaces({}, All(10), 10).faces, 1);
  EXPECT_TRUE(BoundFaces({}, All(10), 10).exact);
}

// Faces 0 and 1 measure five targets each, face 2 measures six of both: greedy takes 2 first and
// needs all three.
TEST(BoundFaces, IsTheSmallestCoverWhereGreedyIsNot) {
  const std::vector<uint64_t> from = {0b101, 0b101, 0b101, 0b001, 0b001,
                                      0b110, 0b110, 0b110, 0b010, 0b010};
  EXPECT_EQ(BoundFaces(from, All(10), 10).faces, 2);
  EXPECT_EQ(BoundFaces(from, All(10), 6).faces, 1);
  EXPECT_EQ(BoundFaces(from, All(10), 7).faces, 2);
}

TEST(BoundFaces, CountsOnlyTargetsThatAreWanted) {
  const std::vector<uint64_t> from = {1, 1, 2, 4};
  TargetBits wanted = All(4);
  EXPECT_EQ(BoundFaces(from, wanted, 4).faces, 3);
  wanted.Reset(3);
  EXPECT_EQ(BoundFaces(from, wanted, 3).faces, 2);
}

TEST(BoundFaces, IsNoClaimWhereTheFacesDoNotReachTheGoal) {
  const std::vector<uint64_t> from = {1, 1, 0, 0};
  const FaceBound bound = BoundFaces(from, All(4), 3);
  EXPECT_EQ(bound.faces, 1);
  EXPECT_FALSE(bound.exact);
}

// 64 targets, each measurable from a face of its own: too many sets of 32 faces to look at all.
TEST(BoundFaces, SaysThatNotAllSetsWereExamined) {
  std::vector<uint64_t> from;
  for (int face = 0; face < 64; ++face) from.push_back(uint64_t{1} << face);
  const FaceBound bound = BoundFaces(from, All(64), 32);
  EXPECT_FALSE(bound.exact);
  EXPECT_GT(bound.faces, 1);
  EXPECT_LE(bound.faces, 32);
}

TEST(BoundExecution, AddsTheLeastTimes) {
  ExecutionModel model;
  model.costs.lay_time_s = 180;
  model.costs.turn_time_s = 60;
  model.costs.move_sensors_time_s = 900;
  const ExecutionBounds bounds = BoundExecution(model, {.faces = 2}, 5, true);
  EXPECT_EQ(bounds.setups, 2);
  EXPECT_DOUBLE_EQ(bounds.time_s, 900 + 2 * 180 + 3 * 60);
  EXPECT_TRUE(bounds.time_converged);
  EXPECT_FALSE(BoundExecution(model, {.faces = 2}, 5, false).time_converged);
  EXPECT_FALSE(BoundExecution(model, {.faces = 2, .exact = false}, 5, true).time_converged);
}

TEST(BoundExecution, KnowsThatRobotsMoveAtNoCostOfAPerson) {
  ExecutionModel model;
  model.costs.lay_time_s = 180;
  model.costs.turn_time_s = 60;
  model.robot_holds_head = true;
  EXPECT_DOUBLE_EQ(BoundExecution(model, {.faces = 2}, 5, true).time_s, 2 * 180);
  model = {};
  model.robot_holds_part = true;
  model.costs.move_sensors_time_s = 900;
  const ExecutionBounds bounds = BoundExecution(model, {.faces = 3}, 5, true);
  EXPECT_EQ(bounds.setups, 1);
  EXPECT_DOUBLE_EQ(bounds.time_s, 900);
}

// No order of scans with these places, faces and turns takes less than the bound.
TEST(BoundExecution, IsBelowEveryPlan) {
  ExecutionModel model;
  model.costs.lay_time_s = 100;
  model.costs.turn_time_s = 70;
  model.costs.move_sensors_time_s = 40;
  for (int faces = 1; faces <= 3; ++faces) {
    std::vector<Measurement> scans;
    for (int i = 0; i < 6; ++i) {
      Measurement m;
      m.part_alpha_rad = i % faces;
      m.camera_polar_rad = 0.1 * (i % 2);
      m.part_gamma_rad = 0.2 * i;
      scans.push_back(m);
    }
    double time_s = TimesBeforeFirst(model).Total_s();
    for (size_t i = 1; i < scans.size(); ++i) {
      time_s += TimesBetween(model, scans[i - 1], scans[i]).Total_s();
    }
    EXPECT_GE(time_s, BoundExecution(model, {.faces = faces}, 6, true).time_s);
  }
}

}  // namespace
}  // namespace sightline
