// SPDX-License-Identifier: Apache-2.0
#include "core/inspection/robot_mount.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/strings/str_replace.h"
#include "core/inspection/inspection.h"
#include "core/json/strict_json.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

using ::testing::HasSubstr;

constexpr char kHead[] = R"({"part": {"file": "a.glb"},
 "rig": {"robot": {"urdf": "arm/arm.urdf", "tip_link": "flange", "load": "LOAD_SENSOR_HEAD",
   "base_position_m": {"x": 1, "y": 2, "z": 3}, "base_roll_pitch_yaw_deg": {"x": 10, "y": 20, "z": 90},
   "home_position": [0.5, 1], "speed_fraction": 0.3}},
 "measurement": {"camera_distance_m": {"fixed": 0.3}, "triangulation_angle_deg": {"fixed": 25}}})";

absl::StatusOr<Inspection> Parse(const std::string& json) {
  v1::Inspection message;
  SIGHTLINE_RETURN_IF_ERROR(ParseStrictJson(json, "i.json", &message));
  return ParseInspection(message, "i.json", "/tasks");
}

void ExpectRefused(const std::string& from, const std::string& to, const std::string& why) {
  const std::string json = absl::StrReplaceAll(kHead, {{from, to}});
  ASSERT_NE(json, kHead) << from;
  const auto inspection = Parse(json);
  ASSERT_FALSE(inspection.ok()) << why;
  EXPECT_EQ(inspection.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(inspection.status().message()), HasSubstr("i.json: "));
  EXPECT_THAT(std::string(inspection.status().message()), HasSubstr(why));
}

TEST(RobotMountTest, ReadsWhatIsGiven) {
  const auto inspection = Parse(kHead);
  ASSERT_TRUE(inspection.ok()) << inspection.status();
  ASSERT_TRUE(inspection->robot);
  const RobotMount& mount = *inspection->robot;
  EXPECT_EQ(mount.urdf_file, "/tasks/arm/arm.urdf");
  EXPECT_EQ(mount.base_link, "");
  EXPECT_EQ(mount.tip_link, "flange");
  EXPECT_EQ(mount.load, RobotMount::Load::kSensorHead);
  EXPECT_EQ(mount.home, (std::vector<double>{0.5, 1}));
  EXPECT_EQ(mount.speed_fraction, 0.3);
  EXPECT_TRUE(mount.base.translation().isApprox(Eigen::Vector3d(1, 2, 3)));
  // Rz(90) Ry(20) Rx(10): the x axis goes to y, and down by the pitch.
  EXPECT_TRUE((mount.base.linear() * Eigen::Vector3d::UnitX())
                  .isApprox(Eigen::Vector3d(0, 0.939692621, -0.342020143), 1e-8));
  EXPECT_TRUE(mount.load_on_tip.isApprox(Eigen::Isometry3d::Identity()));
  EXPECT_FALSE(Parse(R"({"part": {"file": "a.glb"}})")->robot);
}

TEST(RobotMountTest, RefusesWhatDoesNotGoTogether) {
  ExpectRefused(R"("urdf": "arm/arm.urdf", )", "", "rig.robot.urdf is missing");
  ExpectRefused(R"("tip_link": "flange", )", "", "rig.robot.tip_link is missing");
  ExpectRefused(R"("load": "LOAD_SENSOR_HEAD",)", "", "rig.robot.load is missing");
  ExpectRefused(R"("speed_fraction": 0.3)", R"("speed_fraction": 0)",
                "rig.robot.speed_fraction is 0, must be in (0, 1]");
  ExpectRefused(R"("speed_fraction": 0.3)", R"("acceleration_time_s": -1)",
                "rig.robot.acceleration_time_s is -1, must be in [0, 60] s");
  ExpectRefused(R"({"x": 1, "y": 2, "z": 3})", R"({"x": 1000})",
                "rig.robot.base_position_m is 1000");
  ExpectRefused(R"({"x": 10, "y": 20, "z": 90})", R"({"x": 1000})",
                "rig.robot.base_roll_pitch_yaw_deg is 1000");
  ExpectRefused("[0.5, 1]", "[0.5, 1e9]", "rig.robot.home_position[1] is 1000000000");
  ExpectRefused(R"({"fixed": 0.3})", R"({"values": [0.3, 0.4]})",
                "measurement.camera_distance_m must be fixed to one value");
  ExpectRefused(R"(, "triangulation_angle_deg": {"fixed": 25})", "",
                "measurement.triangulation_angle_deg must be fixed to one value");
  ExpectRefused(
      R"("measurement")",
      R"("obstacles": [{"name": "w", "file": "w.glb", "frame": "FRAME_WORLD"}], "measurement")",
      "obstacles[0].frame is FRAME_WORLD");
  ExpectRefused("LOAD_SENSOR_HEAD", "LOAD_PART", "rig.part_holding must be");
}

TEST(RobotMountTest, CarriedPartsAreNotOnATable) {
  const std::string carried = absl::StrReplaceAll(
      kHead, {{"LOAD_SENSOR_HEAD", "LOAD_PART"},
              {R"("rig": {)", R"("rig": {"part_holding": "PART_HOLDING_FREE", )"}});
  const auto inspection = Parse(carried);
  ASSERT_TRUE(inspection.ok()) << inspection.status();
  EXPECT_EQ(inspection->robot->load, RobotMount::Load::kPart);
  const auto refused = Parse(absl::StrReplaceAll(
      carried,
      {{R"("measurement")",
        R"("obstacles": [{"name": "w", "file": "w.glb", "frame": "FRAME_STAGE"}], "measurement")"}}));
  ASSERT_FALSE(refused.ok());
  EXPECT_THAT(std::string(refused.status().message()),
              HasSubstr("obstacles[0].frame must be FRAME_PART or FRAME_WORLD"));
}

}  // namespace
}  // namespace sightline
