// SPDX-License-Identifier: Apache-2.0
// `sightline plan` and `evaluate` of a part that rests on a table, as processes.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "sightline/v1/plan.pb.h"
#include "tests/integration/planning/box_process.h"

namespace sightline {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr char kRestingInspection[] = R"({
  "name": "box", "part": {"file": "box.obj", "unit": "mm"},
  "goal": {"coverage": 0.9}
})";

constexpr char kRestingOptions[] =
    " --evaluations-per-scan 500 --bound-evaluations 0 --no-pictures --no-point-clouds"
    " --field-directions 576";

class RestingProcessTest : public BoxProcessTest {
 protected:
  RestingProcessTest() : BoxProcessTest(kRestingInspection) {}
};

TEST_F(RestingProcessTest, TheDefaultPlanCanBeSetUp) {
  const auto [code, output] = Run(std::string("plan inspection.json --out a") + kRestingOptions);
  ASSERT_EQ(code, 0) << output;
  EXPECT_THAT(output, AllOf(HasSubstr("rests on faces A"), HasSubstr("the part is laid on face")));
  const v1::Plan plan = Read<v1::Plan>("a/plan.json");
  ASSERT_GE(plan.scans_size(), 1);
  ASSERT_GE(plan.resting_faces_size(), 1);
  EXPECT_GE(plan.coverage().coverage(), 0.9);
  EXPECT_EQ(plan.coverage().measurable_targets(), plan.coverage().targets());
  for (const v1::PlannedScan& scan : plan.scans()) {
    ASSERT_TRUE(scan.has_resting_face());
    ASSERT_LT(scan.resting_face(), plan.resting_faces_size());
    const v1::RestingFace& face = plan.resting_faces(scan.resting_face());
    EXPECT_NEAR(scan.measurement().part_alpha_deg(), face.part_alpha_deg(), 1e-9);
    EXPECT_NEAR(scan.measurement().part_beta_deg(), face.part_beta_deg(), 1e-9);
    EXPECT_NEAR(scan.table_height_m(), scan.measurement().offset_z_m() - face.centre_height_m(),
                1e-9);
    EXPECT_EQ(scan.remarks_size(), 0);
    // Depth per pixel: the triangulation angle is worth the distance.
    const double footprint_m =
        scan.measurement().camera_distance_m() / (256 / std::tan(22.5 * M_PI / 180));
    EXPECT_LT(
        footprint_m / std::sin(std::abs(scan.measurement().triangulation_angle_deg()) * M_PI / 180),
        0.006);
  }
  EXPECT_THAT(Bytes("a/report.html"),
              AllOf(HasSubstr("How the part lies"),
                    HasSubstr("The part is laid on the table on one of its faces")));
}

TEST_F(RestingProcessTest, OneFaceLeavesItsUndersideUnmeasurable) {
  Write("one.json", R"({"part": {"file": "box.obj", "unit": "mm"},
    "measurement": {"resting_orientations": [{"name": "bottom"}]}})");
  const auto [code, output] = Run(std::string("plan one.json --out a") + kRestingOptions);
  ASSERT_EQ(code, 0) << output;
  const v1::Plan plan = Read<v1::Plan>("a/plan.json");
  // 24 of 88 square centimetres lie on the table.
  const auto targets = static_cast<double>(plan.coverage().targets());
  EXPECT_NEAR(static_cast<double>(plan.coverage().measurable_targets()) / targets, 64.0 / 88, 0.03);
  EXPECT_EQ(plan.coverage().measurable_in_free_space_targets(), plan.coverage().targets());
  EXPECT_THAT(output, HasSubstr("this rig cannot measure"));
  ASSERT_EQ(plan.resting_faces_size(), 1);
  EXPECT_EQ(plan.resting_faces(0).name(), "bottom");
}

TEST_F(RestingProcessTest, RemarksOnScansByHandAndTheirOrderStays) {
  Write("hand.json", R"({"scans": [
    {"measurement": {"camera_distance_m": 0.3, "triangulation_angle_deg": 30, "camera_polar_deg": 80,
                     "part_alpha_deg": 20}},
    {"measurement": {"camera_distance_m": 0.3, "triangulation_angle_deg": 30}},
    {"measurement": {"camera_distance_m": 0.3, "triangulation_angle_deg": 30}}]})");
  const auto [code, output] =
      Run("evaluate inspection.json hand.json --out e --no-pictures --no-point-clouds");
  ASSERT_EQ(code, 0) << output;
  const v1::Plan plan = Read<v1::Plan>("e/plan.json");
  ASSERT_EQ(plan.scans_size(), 3);
  EXPECT_EQ(plan.scans(0).measurement().part_alpha_deg(), 20);
  EXPECT_FALSE(plan.scans(0).has_resting_face());
  ASSERT_GE(plan.scans(0).remarks_size(), 1);
  EXPECT_THAT(plan.scans(0).remarks(0), HasSubstr("none of its resting faces"));
  EXPECT_EQ(plan.scans(1).remarks_size(), 0);
  ASSERT_EQ(plan.scans(2).remarks_size(), 1);
  EXPECT_THAT(plan.scans(2).remarks(0), HasSubstr("adds little"));
  EXPECT_THAT(output, HasSubstr("scan 1: the part lies on none of its resting faces"));
}

TEST_F(RestingProcessTest, ATableThroughThePartIsRefused) {
  // 200 x 200 x 20 mm, upper face at z = 0.
  Write("table.obj", R"(v -100 -100 -20
v 100 -100 -20
v 100 100 -20
v -100 100 -20
v -100 -100 0
v 100 -100 0
v 100 100 0
v -100 100 0
f 1 4 3 2
f 5 6 7 8
f 1 2 6 5
f 2 3 7 6
f 3 4 8 7
f 4 1 5 8
)");
  for (const char* frame : {"FRAME_STAGE", "FRAME_TABLE"}) {
    Write("table.json", absl::StrCat(R"({"part": {"file": "box.obj", "unit": "mm"},
      "obstacles": [{"name": "granite", "file": "table.obj", "unit": "mm", "frame": ")",
                                     frame, R"("}]})"));
    const auto [code, output] = Run(std::string("plan table.json --out t") + kRestingOptions);
    if (std::string(frame) == "FRAME_TABLE") {
      EXPECT_EQ(code, 0) << output;
      continue;
    }
    EXPECT_EQ(code, 2) << output;
    EXPECT_THAT(output, AllOf(HasSubstr("table.json: obstacles[0] \"granite\" cuts into the part"),
                              HasSubstr("cm3"), HasSubstr("face A")));
  }
}

}  // namespace
}  // namespace sightline
