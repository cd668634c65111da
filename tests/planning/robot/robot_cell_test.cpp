// SPDX-License-Identifier: Apache-2.0
#include "planning/robot/robot_cell.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "planning/robot/nearest_reachable.h"
#include "tests/planning/robot/cell_fixture.h"

namespace sightline {
namespace {

using ::testing::HasSubstr;

constexpr ScanTravel kTravel{-0.1, 0.1};

class RobotCellTest : public CellTest {};

// With the head on the arm, the camera is where the scan wants it, seen from the part: that is all
// that defines a scan.
TEST_F(RobotCellTest, ArmPutsTheHeadWhereTheScanWantsItOverThePart) {
  const CellTask task = HeadTask();
  const auto cell = Make(task);
  ASSERT_NE(cell, nullptr);
  int index = 0;
  for (const double polar : {0.0, 0.3, 0.6}) {
    for (const double alpha : {0.0, kPi, kPi / 2}) {
      Measurement scan = HeadScan();
      scan.camera_polar_rad = polar;
      scan.camera_azimuth_rad = 0.7 * ++index;
      scan.part_alpha_rad = alpha;
      scan.part_gamma_rad = 0.3 * index;
      scan.offset_y_m = 0.05;
      scan.offset_z_m = -0.03;
      const Reach reach = cell->Reachable(scan, kTravel, true);
      ASSERT_TRUE(reach.reachable()) << reach.because;
      for (const ScanPosition& position : reach.positions) {
        EXPECT_EQ(position.start, position.end);
        const Eigen::Isometry3d tip =
            cell->LinksInPart(scan, 0.07, position.start)[cell->model().tip];
        const Eigen::Isometry3d camera = tip * task.mount.load_on_tip;
        const ScanGeometry geometry = MakeScanGeometry(task.rig, scan);
        const Eigen::Isometry3d wanted(
            WorldToPart(geometry, task.part_centre_m, geometry.camera, 0.07).Matrix());
        EXPECT_LT((camera.translation() - wanted.translation()).norm(), 1e-4);
        EXPECT_LT((camera.linear() - wanted.linear()).norm(), 1e-3);
      }
    }
  }
}

TEST_F(RobotCellTest, PartStaysOnItsTableWhateverTheOffsets) {
  // The lowest point of the part is at z = 0 of the cell: the arm's base at the same height touches
  // the plane through it, so that the flange is as high over the part's base as the scan has it.
  const CellTask task = HeadTask();
  const auto cell = Make(task);
  ASSERT_NE(cell, nullptr);
  for (const double alpha : {0.0, kPi / 2}) {
    for (const double offset : {-0.05, 0.0, 0.05}) {
      Measurement scan = HeadScan();
      scan.part_alpha_rad = alpha;
      scan.offset_z_m = offset;
      const std::vector<NamedSolid> around = cell->Around(scan, 0.02);
      ASSERT_EQ(around.size(), 1u);
      const Eigen::Isometry3d part = task.mount.base * around[0].pose;
      double lowest_m = 1;
      for (const Eigen::Vector3f& p : task.part->positions_m) {
        lowest_m = std::min(lowest_m, (part * p.cast<double>()).z());
      }
      EXPECT_NEAR(lowest_m, 0, 1e-9);
      const Eigen::Vector3d centre = part * task.part_centre_m;
      EXPECT_NEAR(centre.x(), 0.02, 1e-9);
      EXPECT_NEAR(centre.y(), 0, 1e-9);
    }
  }
}

TEST_F(RobotCellTest, SaysWhyAScanIsNotReached) {
  CellTask task = HeadTask();
  // Too far away.
  task.mount.base.translation() = Eigen::Vector3d(0, -2.5, 0);
  auto cell = Make(task);
  ASSERT_NE(cell, nullptr);
  EXPECT_THAT(cell->Reachable(HeadScan(), kTravel, false).because, HasSubstr("outside reach: "));
  // An obstacle all about the part, which travels with it.
  task = HeadTask();
  task.obstacles.push_back(
      {"hood",
       std::make_shared<const TriangleMesh>(BoxMesh({-0.4f, -0.4f, 0.1f}, {0.4f, 0.4f, 0.9f})),
       ObstacleFrame::kStage});
  cell = Make(task);
  ASSERT_NE(cell, nullptr);
  const Reach reach = cell->Reachable(HeadScan(), kTravel, false);
  EXPECT_FALSE(reach.reachable());
  EXPECT_THAT(reach.because, HasSubstr("collision: "));
  EXPECT_THAT(reach.because, HasSubstr("with hood"));
}

TEST_F(RobotCellTest, NamesTheJointThatIsBeyondItsLimit) {
  CellTask task = HeadTask();
  task.mount.urdf_file = Write("arm.urdf", [] {
    std::ifstream file(ExampleArm());
    std::string text((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
    // The elbow hardly bends.
    const std::string from = R"(lower="-3.141592653589793" upper="3.141592653589793")";
    text.replace(text.find(from), from.size(), R"(lower="-0.2" upper="0.2")");
    return text;
  }());
  task.mount.home = {-kPi / 2, -kPi / 2, 0, -kPi / 2, -kPi / 2, 0};
  const auto cell = Make(task);
  ASSERT_NE(cell, nullptr);
  const Reach reach = cell->Reachable(HeadScan(), kTravel, false);
  EXPECT_FALSE(reach.reachable());
  EXPECT_THAT(reach.because, HasSubstr("joint limit: elbow_joint would be at "));
  EXPECT_THAT(reach.because, HasSubstr("deg, its limits are -11.5 to 11.5"));
}

// An obstacle that a scan passes only in the middle of its travel counts.
TEST_F(RobotCellTest, WholeTravelIsLookedAt) {
  CellTask task = HeadTask();
  task.obstacles.push_back(
      {"post",
       std::make_shared<const TriangleMesh>(BoxMesh({0.35f, -0.6f, 0.0f}, {0.37f, 0.3f, 0.75f})),
       ObstacleFrame::kStage});
  const auto cell = Make(task);
  ASSERT_NE(cell, nullptr);
  EXPECT_TRUE(cell->Reachable(HeadScan(), {0.1, 0.2}, false).reachable());
  const Reach through = cell->Reachable(HeadScan(), {-1.0, 0.2}, false);
  EXPECT_THAT(through.because, HasSubstr("with post"));
}

TEST_F(RobotCellTest, TurntableOnAStageCarriesThePartAlong) {
  const CellTask task = TurntableTask();
  const auto cell = Make(task);
  ASSERT_NE(cell, nullptr);
  Measurement scan = HeadScan();
  scan.part_gamma_rad = 1.2;
  const Reach reach = cell->Reachable(scan, kTravel, true);
  ASSERT_TRUE(reach.reachable()) << reach.because;
  const ScanPosition& position = reach.positions[0];
  EXPECT_NEAR(position.start[0], -0.1, 1e-4);
  EXPECT_NEAR(position.end[0], 0.1, 1e-4);
  EXPECT_NEAR(position.start[1], 1.2, 1e-3);
  EXPECT_NEAR(position.end[1], 1.2, 1e-3);
  // Beyond the stage, above it, and off its axis.
  EXPECT_THAT(cell->Reachable(scan, {-0.1, 0.35}, false).because,
              HasSubstr("joint limit: stage would be at 3"));
  Measurement higher = scan;
  higher.offset_z_m = 0.05;
  EXPECT_THAT(cell->Reachable(higher, kTravel, false).because, HasSubstr("outside reach"));
  Measurement tilted = scan;
  tilted.part_alpha_rad = 0.5;
  EXPECT_THAT(cell->Reachable(tilted, kTravel, false).because, HasSubstr("outside reach"));
  // The carriage against a sensor that looks from below the part.
  Measurement low = scan;
  low.camera_polar_rad = 1.55;
  low.camera_distance_m = 0.12;
  EXPECT_THAT(cell->Reachable(low, kTravel, false).because, HasSubstr("collision: "));
}

TEST_F(RobotCellTest, HomeMustNotTouchTheArmItself) {
  CellTask task = HeadTask();
  task.mount.home = {0, 0, kPi - 0.01, 0, 0, 0};
  const auto cell = RobotCell::Make(std::move(task));
  ASSERT_FALSE(cell.ok());
  EXPECT_EQ(cell.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(cell.status().message()), HasSubstr("rig.robot.home_position: there "));
}

TEST_F(RobotCellTest, TravelIsWhereTheSheetLightsWhatTheCameraSees) {
  Rig rig;
  // The upper face of the box: 0.2 m long, lit from straight above where the sheet passes.
  TargetSet targets;
  for (int i = 0; i <= 100; ++i) {
    targets.positions_m.emplace_back(0.002f * static_cast<float>(i), 0.05f, 0.06f);
    targets.normals.emplace_back(0.0f, 0.0f, 1.0f);
  }
  Measurement scan = HeadScan();
  scan.camera_polar_rad = scan.triangulation_angle_rad;  // the laser looks straight down
  const ScanTravel travel =
      EstimateTravel(rig, targets, 0.005, Eigen::Vector3d(0.1, 0.05, 0.03), scan);
  EXPECT_NEAR(travel.start_m, -0.105, 1e-6);
  EXPECT_NEAR(travel.end_m, 0.105, 1e-6);
  // From below nothing of it is lit.
  scan.part_alpha_rad = kPi;
  const ScanTravel none =
      EstimateTravel(rig, targets, 0.005, Eigen::Vector3d(0.1, 0.05, 0.03), scan);
  EXPECT_EQ(none.start_m, 0);
  EXPECT_EQ(none.end_m, 0);
}

TEST_F(RobotCellTest, OffersTheNearestScanThatItReaches) {
  CellTask task = HeadTask();
  // 0.35 m nearer to its limit: what lies far to the +y side is out of reach.
  task.mount.base.translation() = Eigen::Vector3d(0, -1.15, 0);
  const auto cell = Make(task);
  ASSERT_NE(cell, nullptr);
  MeasurementDomain domain = ThesisDomain();
  for (const int p : {0, 1, 4, 5, 6}) {
    domain.parameters[p].ranges.clear();
    domain.parameters[p].values = {ToArray(HeadScan())[static_cast<size_t>(p)]};
  }
  const auto travel_of = [](const Measurement&) { return kTravel; };
  Measurement far = HeadScan();
  far.camera_azimuth_rad = kPi / 2;
  far.camera_polar_rad = 1.2;
  ASSERT_FALSE(cell->Reachable(far, kTravel, false).reachable());
  const auto near = NearestReachable(*cell, domain, far, travel_of, nullptr);
  ASSERT_TRUE(near);
  EXPECT_TRUE(cell->Reachable(*near, kTravel, false).reachable());
  EXPECT_TRUE(domain.Contains(*near));
  EXPECT_EQ(ToArray(*near), ToArray(*NearestReachable(*cell, domain, far, travel_of, nullptr)));
  // No farther than halfway through the domain of any parameter.
  EXPECT_GT(near->camera_polar_rad, 0.4);
  EXPECT_THAT(DifferenceText(*near, far), HasSubstr("camera_"));
  EXPECT_EQ(DifferenceText(far, far), "");
  const std::atomic<bool> interrupted = true;
  EXPECT_FALSE(NearestReachable(*cell, domain, far, travel_of, &interrupted));
}

}  // namespace
}  // namespace sightline
