// SPDX-License-Identifier: Apache-2.0
// `sightline plan` and `evaluate` with a robot as processes, with the server they start.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <string>

#include "absl/strings/str_replace.h"
#include "sightline/v1/plan.pb.h"
#include "tests/integration/planning/box_process.h"

namespace sightline {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;

constexpr char kRobotInspection[] = R"({
  "name": "box", "part": {"file": "box.obj", "unit": "mm"},
  "rig": {"robot": {"urdf": "arm.urdf", "base_link": "cell", "tip_link": "flange",
    "load": "LOAD_SENSOR_HEAD", "base_position_m": {"y": -0.9},
    "load_position_m": {"y": 0.0875, "z": 0.15},
    "home_position": [-1.5708, -1.5708, 1.5708, -1.5708, -1.5708, 0]}},
  "measurement": {"camera_distance_m": {"fixed": 0.35}, "triangulation_angle_deg": {"fixed": 30},
    "resting_orientations": [{"part_alpha_deg": 0, "part_beta_deg": 0}]},
  "targets": {"spacing_m": 0.004},
  "goal": {"coverage": 0.7, "max_scans": 4}
})";

constexpr char kRobotOptions[] =
    " --evaluations-per-scan 300 --bound-evaluations 0 --no-pictures --field-directions 576";

class RobotProcessTest : public BoxProcessTest {
 protected:
  RobotProcessTest() : BoxProcessTest(kRobotInspection) {}
  void SetUp() override {
    const char* source = std::getenv("SIGHTLINE_SOURCE_DIR");
    ASSERT_NE(source, nullptr);
    BoxProcessTest::SetUp();
    std::filesystem::copy_file(
        std::string(source) + "/examples/cylinder_head_robot/ur10e_cell.urdf",
        folder_ + "/arm.urdf");
  }
};

TEST_F(RobotProcessTest, PlansWithinReachTheSameEveryTime) {
  const auto [code, output] = Run(std::string("plan inspection.json --out a") + kRobotOptions);
  ASSERT_EQ(code, 0) << output;
  EXPECT_THAT(output, HasSubstr("robot: ur10e_cell reaches "));
  EXPECT_THAT(output, HasSubstr("the robot moves "));
  const v1::Plan plan = Read<v1::Plan>("a/plan.json");
  ASSERT_GT(plan.scans_size(), 0);
  double sum_s = 0;
  for (const v1::PlannedScan& scan : plan.scans()) {
    EXPECT_TRUE(scan.robot().reachable()) << scan.robot().because();
    EXPECT_EQ(scan.robot().start_position_size(), 6);
    EXPECT_EQ(scan.robot().end_position_size(), 6);
    EXPECT_GT(scan.robot().move_time_s(), 0);
    sum_s += scan.robot().move_time_s();
  }
  EXPECT_NEAR(plan.robot_move_time_s(), sum_s, 1e-9);
  EXPECT_THAT(Bytes("a/report.html"), HasSubstr("\"title\":\"Robot\""));
  EXPECT_THAT(Bytes("a/report.html"), HasSubstr("shoulder_pan_joint"));

  ASSERT_EQ(Run(std::string("plan inspection.json --out b") + kRobotOptions).first, 0);
  EXPECT_EQ(Bytes("a/plan.json"), Bytes("b/plan.json"));
}

TEST_F(RobotProcessTest, ScansOutOfReachAreSaidToBe) {
  // From behind the part, nearly level: the arm would have to reach over it.
  Write("hand.json", R"({"scans": [{"measurement": {"camera_distance_m": 0.35,
    "triangulation_angle_deg": 30, "camera_azimuth_deg": 90, "camera_polar_deg": 80,
    "offset_y_m": -0.4}}]})");
  const auto [code, output] =
      Run("evaluate inspection.json hand.json --out c --no-pictures --no-point-clouds");
  ASSERT_EQ(code, 0) << output;
  EXPECT_THAT(output, HasSubstr("it cannot make 1 of 1 scans"));
  const v1::Plan plan = Read<v1::Plan>("c/plan.json");
  ASSERT_EQ(plan.scans_size(), 1);
  EXPECT_FALSE(plan.scans(0).robot().reachable());
  EXPECT_FALSE(plan.scans(0).robot().because().empty());
  EXPECT_THAT(plan.scans(0).remarks(), Contains(HasSubstr("the nearest reachable scan found")));
}

// The gains are those of the gain model that the robot's asks.
TEST_F(RobotProcessTest, ComparesGainsWithinReach) {
  Write("uncertain.json",
        absl::StrReplaceAll(kRobotInspection, {{R"("goal": {"coverage": 0.7, "max_scans": 4})",
                                                R"("goal": {"admissible": 0.3, "max_scans": 3},
  "uncertainty": {"line_detection": {"standard_deviation_px": 0.1}, "calibration": {},
    "registration": "NONE"},
  "tolerances": {"regions": [{"name": "top", "zone_width_m": 0.0002,
    "min_m": {"x": -1, "y": -1, "z": 0.0199}, "max_m": {"x": 1, "y": 1, "z": 1}}]})"}}));
  const auto [code, output] = Run(
      "compare uncertain.json --out gains --strategies refined --gains ra:0.5,tu,information,own "
      "--seeds 1 --evaluations-per-scan 100");
  ASSERT_EQ(code, 0) << output;
  for (const char* row : {"refined ra:0.5", "refined tu", "refined information", "refined own"}) {
    EXPECT_THAT(output, HasSubstr(row));
    EXPECT_THAT(Bytes("gains/comparison.csv"), HasSubstr(row));
  }
}

TEST_F(RobotProcessTest, WrongRobotsAreWrongInput) {
  const auto refused = [&](const std::string& from, const std::string& to) {
    Write("wrong.json", absl::StrReplaceAll(kRobotInspection, {{from, to}}));
    const auto [code, output] = Run("plan wrong.json --out d");
    EXPECT_EQ(code, 2) << output;
    return output;
  };
  EXPECT_THAT(refused("arm.urdf", "other.urdf"), HasSubstr("other.urdf: no such file"));
  EXPECT_THAT(refused("\"flange\"", "\"hand\""), HasSubstr("has no link \"hand\""));
  std::string urdf = Bytes("arm.urdf");
  ASSERT_THAT(urdf, HasSubstr("<collision>"));
  Write("misspelt.urdf", absl::StrReplaceAll(urdf, {{"collision>", "colision>"}}));
  EXPECT_THAT(refused("arm.urdf", "misspelt.urdf"),
              HasSubstr("unknown element \"colision\"; did you mean <collision>?"));
  EXPECT_THAT(refused("\"fixed\": 0.35", "\"values\": [0.3, 0.35]"),
              HasSubstr("measurement.camera_distance_m must be fixed"));
  EXPECT_THAT(refused("[-1.5708, ", "["), HasSubstr("home_position has 5 entries"));
}

}  // namespace
}  // namespace sightline
