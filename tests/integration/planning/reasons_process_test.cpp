// SPDX-License-Identifier: Apache-2.0
// `sightline evaluate` as a process: why targets are not covered.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "sightline/v1/plan.pb.h"
#include "tests/integration/planning/box_process.h"

namespace sightline {
namespace {

using ::testing::HasSubstr;

// Lies as in the file; a clamp 2 mm over one half of the top hides that.
constexpr char kReasonsInspection[] = R"({
  "name": "box", "part": {"file": "box.obj", "unit": "mm"},
  "rig": {"part_holding": "PART_HOLDING_FREE"},
  "measurement": {"part_alpha_deg": {"fixed": 0}, "part_beta_deg": {"fixed": 0},
                  "camera_polar_deg": {"ranges": [{"min": 0, "max": 30}]},
                  "triangulation_angle_deg": {"ranges": [{"min": 15, "max": 40}]}},
  "obstacles": [{"name": "clamp <A>", "file": "clamp.obj", "unit": "mm", "frame": "FRAME_PART"}],
  "targets": {"spacing_m": 0.003, "max_incidence_deg": 90, "regions": [
    {"name": "clamped end", "spacing_m": 0.003, "min_m": {"x": 0.04, "y": -1, "z": 0.0199},
     "max_m": {"x": 1, "y": 1, "z": 0.0201}},
    {"name": "free end", "spacing_m": 0.002, "min_m": {"x": 0, "y": -1, "z": 0.0199},
     "max_m": {"x": 0.015, "y": 1, "z": 0.0201}}]}
})";

// From the middle of the box to beyond it on three sides.
constexpr char kClamp[] = R"(v 30 -20 22
v 90 -20 22
v 90 60 22
v 30 60 22
v 30 -20 24
v 90 -20 24
v 90 60 24
v 30 60 24
f 1 4 3 2
f 5 6 7 8
f 1 2 6 5
f 2 3 7 6
f 3 4 8 7
f 4 1 5 8
)";

constexpr char kReasonsPlan[] = R"({"scans": [{"measurement": {
  "camera_distance_m": 0.4, "triangulation_angle_deg": 25, "camera_polar_deg": 20}}]})";

class ReasonsProcessTest : public BoxProcessTest {
 protected:
  ReasonsProcessTest() : BoxProcessTest(kReasonsInspection) {}
  void SetUp() override {
    BoxProcessTest::SetUp();
    Write("clamp.obj", kClamp);
    Write("hand.json", kReasonsPlan);
  }
};

std::map<std::string, int64_t> ByReason(
    const google::protobuf::RepeatedPtrField<v1::UncoveredCount>& counts) {
  std::map<std::string, int64_t> result;
  for (const v1::UncoveredCount& count : counts) {
    result[absl::StrCat(v1::UncoveredReason_Name(count.reason()), " ", count.obstacle())] +=
        count.targets();
  }
  return result;
}

TEST_F(ReasonsProcessTest, CountsReasonsOfAllTargetsAndOfRegions) {
  const auto [code, output] =
      Run("evaluate inspection.json hand.json --out a --no-pictures --no-point-clouds");
  ASSERT_EQ(code, 0) << output;
  EXPECT_THAT(output, HasSubstr("hidden by clamp <A>"));
  const v1::PlanCoverage coverage = Read<v1::Plan>("a/plan.json").coverage();
  int64_t sum = 0, not_measurable = 0;
  for (const v1::UncoveredCount& count : coverage.uncovered()) {
    sum += count.targets();
    if (!count.measurable()) not_measurable += count.targets();
    EXPECT_GT(count.targets(), 0);
    EXPECT_EQ(count.obstacle().empty(), count.reason() != v1::UNCOVERED_REASON_OBSTACLE);
  }
  EXPECT_EQ(sum, coverage.targets() - coverage.covered_targets());
  EXPECT_EQ(not_measurable, coverage.targets() - coverage.measurable_targets());
  auto reasons = ByReason(coverage.uncovered());
  // Underside: 24 of 88 square centimetres; no scan of the domain comes from there.
  const auto targets = static_cast<double>(coverage.targets());
  EXPECT_NEAR(static_cast<double>(reasons["UNCOVERED_REASON_ANGLE "]) / targets, 24.0 / 88, 0.1);
  EXPECT_GT(reasons["UNCOVERED_REASON_OBSTACLE clamp <A>"], 0);

  ASSERT_EQ(coverage.regions_size(), 2);
  const v1::RegionCoverage& clamped = coverage.regions(0);
  const v1::RegionCoverage& free = coverage.regions(1);
  EXPECT_EQ(clamped.name(), "clamped end");
  EXPECT_GT(clamped.targets(), 20);
  EXPECT_EQ(clamped.covered_targets(), 0);
  auto of_clamped = ByReason(clamped.uncovered());
  EXPECT_EQ(of_clamped["UNCOVERED_REASON_OBSTACLE clamp <A>"], clamped.targets());
  EXPECT_EQ(free.name(), "free end");
  EXPECT_GT(free.targets(), 50);
  // One scan measures most of it; others would measure the rest.
  EXPECT_EQ(free.measurable_targets(), free.targets());
  EXPECT_GT(free.covered_targets(), free.targets() / 2);
  auto of_free = ByReason(free.uncovered());
  EXPECT_EQ(of_free["UNCOVERED_REASON_NOT_CHOSEN "], free.targets() - free.covered_targets());

  const std::string report = Bytes("a/report.html");
  EXPECT_THAT(report, HasSubstr("Why places are not measured"));
  EXPECT_THAT(report, HasSubstr("hidden by clamp \\u003cA>"));
  EXPECT_THAT(report, HasSubstr("clamped end"));

  ASSERT_EQ(Run("evaluate inspection.json hand.json --out b --no-pictures --no-point-clouds").first,
            0);
  EXPECT_EQ(Bytes("a/plan.json"), Bytes("b/plan.json"));
}

TEST_F(ReasonsProcessTest, ACollisionNamesWhatIsTouched) {
  // The camera's body is there when it looks down from 0.4 m.
  std::string beam = kClamp;
  for (const auto& [from, to] :
       {std::pair(" 22\n", " 440\n"), std::pair(" 24\n", " 460\n"), std::pair("v 30 ", "v -100 "),
        std::pair("v 90 ", "v 100 "), std::pair(" -20 ", " -100 "), std::pair(" 60 ", " 100 ")}) {
    beam = absl::StrReplaceAll(beam, {{from, to}});
  }
  Write("beam.obj", beam);
  Write("beam.json", R"({"part": {"file": "box.obj", "unit": "mm"},
    "obstacles": [{"name": "beam", "file": "beam.obj", "unit": "mm", "frame": "FRAME_WORLD"}],
    "measurement": {"resting_orientations": [{"name": "bottom"}],
                    "camera_distance_m": {"fixed": 0.4},
                    "camera_polar_deg": {"ranges": [{"min": 0, "max": 3}]},
                    "triangulation_angle_deg": {"ranges": [{"min": 15, "max": 40}]}},
    "targets": {"required_resolution_m": 0}})");
  const auto [code, output] =
      Run("evaluate beam.json hand.json --out a --no-pictures --no-point-clouds");
  ASSERT_EQ(code, 0) << output;
  EXPECT_THAT(output, HasSubstr("camera or laser would touch beam ("));
  const v1::PlanCoverage coverage = Read<v1::Plan>("a/plan.json").coverage();
  EXPECT_GT(ByReason(coverage.uncovered())["UNCOVERED_REASON_COLLISION beam"], 0);
}

TEST_F(ReasonsProcessTest, RefusesADistanceWithoutRoomForCameraAndLaser) {
  Write("near.json", R"({"part": {"file": "box.obj", "unit": "mm"},
    "measurement": {"camera_distance_m": {"fixed": 0.12},
                    "triangulation_angle_deg": {"ranges": [{"min": 10, "max": 15}]}},
    "targets": {"required_resolution_m": 0}})");
  const auto [code, output] = Run("plan near.json --out a --no-pictures");
  EXPECT_EQ(code, 2) << output;
  EXPECT_THAT(output, HasSubstr("the bodies of camera and laser (rig.camera_bodies"));
}

TEST_F(ReasonsProcessTest, RefusesARegionWithoutTargets) {
  Write("far.json", absl::StrReplaceAll(kReasonsInspection, {{"\"x\": 0.04,", "\"x\": 0.4,"}}));
  const auto [code, output] = Run("evaluate far.json hand.json --out a");
  EXPECT_EQ(code, 2) << output;
  EXPECT_THAT(output, HasSubstr("targets.regions[0] (\"clamped end\") holds no target"));
}

}  // namespace
}  // namespace sightline
