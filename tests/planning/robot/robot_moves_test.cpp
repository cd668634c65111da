// SPDX-License-Identifier: Apache-2.0
#include "planning/robot/robot_moves.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "core/random/random.h"
#include "tests/planning/robot/cell_fixture.h"

namespace sightline {
namespace {

using ::testing::HasSubstr;

const TimeBetween kNothing = [](int, int) { return 0.0; };

class RobotMovesTest : public CellTest {
 protected:
  static std::vector<ScanToReach> RandomScans(int count, uint64_t seed) {
    Random random(seed);
    std::vector<ScanToReach> scans;
    for (int i = 0; i < count; ++i) {
      Measurement scan = HeadScan();
      scan.camera_azimuth_rad = 2 * kPi * random.Uniform();
      scan.camera_polar_rad = 0.6 * random.Uniform();
      scan.offset_y_m = 0.1 * random.Uniform();
      scans.push_back({scan, {-0.1, 0.1}});
    }
    return scans;
  }
  static double Sum(const std::vector<RobotMove>& moves) {
    double sum_s = 0;
    for (const RobotMove& move : moves) sum_s += move.move_time_s;
    return sum_s;
  }
};

TEST_F(RobotMovesTest, TimeIsThatOfTheSlowestJoint) {
  CellTask task = HeadTask();
  task.mount.speed_fraction = 0.5;
  const auto cell = Make(task);
  ASSERT_NE(cell, nullptr);
  const JointPositions home = cell->model().home;
  JointPositions to = home;
  to[0] += 1;  // 120 deg/s
  to[4] -= 1;  // 180 deg/s
  EXPECT_NEAR(cell->MoveTimeS(home, to), 1 / (0.5 * 2 * kPi / 3), 1e-9);
  EXPECT_EQ(cell->MoveTimeS(home, home), 0);
}

// Constant acceleration a = v / T: of a way s at least v T long s / v + T, of a shorter one
// 2 sqrt(s / a).
TEST_F(RobotMovesTest, StartingAndStoppingTakeTime) {
  CellTask task = HeadTask();
  task.mount.speed_fraction = 0.5;
  task.mount.acceleration_time_s = 0.4;
  const auto cell = Make(task);
  ASSERT_NE(cell, nullptr);
  const double speed = 0.5 * 2 * kPi / 3, acceleration = speed / 0.4;
  const JointPositions home = cell->model().home;
  JointPositions to = home;
  to[0] += 1;
  EXPECT_NEAR(cell->MoveTimeS(home, to), 1 / speed + 0.4, 1e-9);
  to[0] = home[0] + 0.1;
  EXPECT_NEAR(cell->MoveTimeS(home, to), 2 * std::sqrt(0.1 / acceleration), 1e-9);
  to[0] = home[0] + speed * 0.4;
  EXPECT_NEAR(cell->MoveTimeS(home, to), 0.8, 1e-9);
  EXPECT_EQ(cell->MoveTimeS(home, home), 0);
}

TEST_F(RobotMovesTest, NoOrderIsSlowerThanTheGivenOne) {
  const auto cell = Make(HeadTask());
  ASSERT_NE(cell, nullptr);
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    const auto scans = RandomScans(6, seed);
    const auto best = SequenceScans(*cell, scans, 0, kNothing, nullptr);
    const auto given = SequenceScans(*cell, scans, 6, kNothing, nullptr);
    ASSERT_EQ(best.size(), 6u);
    std::set<int> all;
    for (const RobotMove& move : best) {
      EXPECT_TRUE(move.reachable) << move.because;
      EXPECT_GT(move.move_time_s, 0);
      all.insert(move.scan);
    }
    EXPECT_EQ(all.size(), 6u);
    for (int i = 0; i < 6; ++i) EXPECT_EQ(given[static_cast<size_t>(i)].scan, i);
    EXPECT_LE(Sum(best), Sum(given) + 1e-9);
    // The times are those of the positions given.
    JointPositions at = cell->model().home;
    for (const RobotMove& move : best) {
      if (move.remark.empty()) {
        EXPECT_NEAR(move.move_time_s, cell->MoveTimeS(at, move.position.start), 1e-9);
      }
      at = move.position.end;
    }
    // The first ones stay where they are locked.
    const auto locked = SequenceScans(*cell, scans, 2, kNothing, nullptr);
    EXPECT_EQ(locked[0].scan, 0);
    EXPECT_EQ(locked[1].scan, 1);
  }
}

TEST_F(RobotMovesTest, TheOrderIsTheSameEveryTime) {
  const auto cell = Make(HeadTask());
  ASSERT_NE(cell, nullptr);
  const auto scans = RandomScans(5, 1);
  const auto once = SequenceScans(*cell, scans, 0, kNothing, nullptr);
  const auto again = SequenceScans(*cell, scans, 0, kNothing, nullptr);
  ASSERT_EQ(once.size(), again.size());
  for (size_t k = 0; k < once.size(); ++k) {
    EXPECT_EQ(again[k].scan, once[k].scan);
    EXPECT_EQ(again[k].position.start, once[k].position.start);
  }
}

TEST_F(RobotMovesTest, OtherTimesCountForTheOrder) {
  const auto cell = Make(HeadTask());
  ASSERT_NE(cell, nullptr);
  const auto scans = RandomScans(5, 4);
  // By hand, going down takes an hour.
  const auto moves = SequenceScans(
      *cell, scans, 0, [](int from, int to) { return from > to ? 3600.0 : 0; }, nullptr);
  for (int i = 0; i < 5; ++i) EXPECT_EQ(moves[static_cast<size_t>(i)].scan, i);
}

TEST_F(RobotMovesTest, ScansOutOfReachTakeNoTimeAndComeLast) {
  const auto cell = Make(HeadTask());
  ASSERT_NE(cell, nullptr);
  auto scans = RandomScans(3, 1);
  Measurement far = HeadScan();
  far.offset_y_m = -3;
  scans.insert(scans.begin() + 1, {far, {0, 0}});
  auto moves = SequenceScans(*cell, scans, 0, kNothing, nullptr);
  ASSERT_EQ(moves.size(), 4u);
  EXPECT_EQ(moves[3].scan, 1);
  EXPECT_FALSE(moves[3].reachable);
  EXPECT_EQ(moves[3].move_time_s, 0);
  EXPECT_THAT(moves[3].because, HasSubstr("outside reach"));
  moves = SequenceScans(*cell, scans, 2, kNothing, nullptr);
  EXPECT_EQ(moves[1].scan, 1);
  EXPECT_FALSE(moves[1].reachable);
  EXPECT_TRUE(SequenceScans(*cell, {}, 0, kNothing, nullptr).empty());
}

// Between two scans on either side stands a wall on the stage: the straight way is not free.
TEST_F(RobotMovesTest, MovesGoAroundOrAreSaidToTouch) {
  CellTask task = HeadTask();
  task.obstacles.push_back(
      {"wall",
       std::make_shared<const TriangleMesh>(BoxMesh({-0.01f, -0.25f, 0.0f}, {0.01f, 0.4f, 0.47f})),
       ObstacleFrame::kStage});
  const auto cell = Make(task);
  ASSERT_NE(cell, nullptr);
  std::vector<ScanToReach> scans;
  for (const double stage_m : {-0.45, 0.45}) {
    Measurement scan = HeadScan();
    scan.camera_polar_rad = 0;
    scan.offset_z_m = 0.2;
    scan.offset_y_m = 0.05;
    // The wall is on one side of the head, then on the other.
    scans.push_back({scan, {stage_m, stage_m}});
  }
  for (const ScanToReach& scan : scans) {
    const Reach reach = cell->Reachable(scan.measurement, scan.travel, true);
    ASSERT_TRUE(reach.reachable()) << reach.because;
  }
  // Straight through the middle, where the wall stands at the stage's middle.
  const Reach low = cell->Reachable(scans[0].measurement, scans[0].travel, false);
  JointPositions left = low.positions[0].start, right = left;
  left[0] -= 0.5;
  right[0] += 0.5;
  const auto contact = cell->OnTheWay(left, right, cell->Around(scans[0].measurement, 0));
  ASSERT_TRUE(contact);
  EXPECT_EQ(contact->second, "wall");
  EXPECT_FALSE(cell->OnTheWay(left, left, cell->Around(scans[0].measurement, -0.45)));
}

TEST_F(RobotMovesTest, InterruptedItEndsSoon) {
  const auto cell = Make(HeadTask());
  ASSERT_NE(cell, nullptr);
  const std::atomic<bool> interrupted = true;
  const auto moves = SequenceScans(*cell, RandomScans(8, 2), 0, kNothing, &interrupted);
  ASSERT_EQ(moves.size(), 8u);
  for (const RobotMove& move : moves) {
    EXPECT_TRUE(move.reachable);
    EXPECT_THAT(move.remark, HasSubstr("was not checked for collisions"));
  }
}

}  // namespace
}  // namespace sightline
