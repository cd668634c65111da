// SPDX-License-Identifier: Apache-2.0
// `sightline evaluate` and `plan` as processes: targets that the light of their material limits.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <string>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "sightline/v1/plan.pb.h"
#include "tests/integration/planning/box_process.h"

namespace sightline {
namespace {

using ::testing::ContainsRegex;
using ::testing::HasSubstr;
using ::testing::Not;

// The top is painted white, the rest is black: it needs 80 ms from 0.5 m where
// 10 ms are permitted.
constexpr char kLightInspection[] = R"({
  "name": "box", "part": {"file": "box.obj", "unit": "mm"},
  "rig": {"part_holding": "PART_HOLDING_FREE"},
  "laser": {"distance_m": 0.5},
  "measurement": {"part_alpha_deg": {"fixed": 0}, "part_beta_deg": {"fixed": 0}},
  "targets": {"spacing_m": 0.004},
  "detectability": {"max_exposure_time_s": 0.01, "table": {"materials": [
    {"part_material": "white_paint", "camera_distances_m": [0.4], "camera_incidence_deg": [0],
     "laser_incidence_deg": [0], "azimuth_deg": [0], "laser_distance_m": 0.5,
     "shortest_exposure_time_s": [1e-4], "longest_exposure_time_s": ["Infinity"]},
    {"camera_distances_m": [0.4], "camera_incidence_deg": [0],
     "laser_incidence_deg": [0], "azimuth_deg": [0], "laser_distance_m": 0.5,
     "shortest_exposure_time_s": [0.08], "longest_exposure_time_s": ["Infinity"]}]}}
})";

constexpr char kPaintedBox[] = R"(v 0 0 0
v 60 0 0
v 60 40 0
v 0 40 0
v 0 0 20
v 60 0 20
v 60 40 20
v 0 40 20
usemtl black_rubber
f 1 4 3 2
f 1 2 6 5
f 2 3 7 6
f 3 4 8 7
f 4 1 5 8
usemtl white_paint
f 5 6 7 8
)";

constexpr char kLightPlan[] = R"({"scans": [{"measurement": {
  "camera_distance_m": 0.4, "triangulation_angle_deg": 25, "camera_polar_deg": 20}}]})";

class LightProcessTest : public BoxProcessTest {
 protected:
  LightProcessTest() : BoxProcessTest(kLightInspection) {}
  void SetUp() override {
    BoxProcessTest::SetUp();
    Write("box.obj", kPaintedBox);
    Write("hand.json", kLightPlan);
  }
};

TEST_F(LightProcessTest, MaterialsDecideWhatIsMeasurable) {
  const auto [code, output] =
      Run("evaluate inspection.json hand.json --out out --no-pictures 2>&1");
  ASSERT_EQ(code, 0) << output;
  EXPECT_THAT(output, HasSubstr("light: exposures of 0.01 ms to 10 ms are permitted"));
  EXPECT_THAT(output,
              ContainsRegex("too dark: needs [0-9.]+.*ms, longer than any permitted exposure"));
  const auto plan = Read<v1::Plan>("out/plan.json");
  const v1::PlanCoverage& coverage = plan.coverage();
  // The top is 24 of the 88 cm2.
  EXPECT_NEAR(
      static_cast<double>(coverage.measurable_targets()) / static_cast<double>(coverage.targets()),
      24.0 / 88, 0.04);
  bool dark = false;
  for (const v1::UncoveredCount& count : coverage.uncovered()) {
    if (count.reason() != v1::UNCOVERED_REASON_TOO_DARK) {
      EXPECT_FALSE(count.has_exposure_time_s());
      continue;
    }
    dark = true;
    EXPECT_FALSE(count.measurable());
    // Scans may have the laser nearer or farther.
    EXPECT_GT(count.exposure_time_s(), 0.02);
    EXPECT_LT(count.exposure_time_s(), 0.1);
    EXPECT_GT(count.targets(), coverage.targets() / 3);  // the sides
  }
  EXPECT_TRUE(dark);
  EXPECT_THAT(Bytes("out/report.json"),
              ContainsRegex(
                  "too dark: needs [0-9.]+.{1,4}ms, the longest permitted exposure is 10.{1,4}ms"));

  // Everything is bright enough with longer exposures.
  Write("inspection.json",
        absl::StrReplaceAll(kLightInspection, {{"0.01, \"table\"", "0.5, \"table\""}}));
  const auto [again, said] = Run("evaluate inspection.json hand.json --out out --no-pictures 2>&1");
  ASSERT_EQ(again, 0) << said;
  const auto longer = Read<v1::Plan>("out/plan.json");
  EXPECT_GT(longer.coverage().measurable_targets(), 2 * coverage.measurable_targets());
  EXPECT_THAT(said, Not(HasSubstr("too dark")));
}

TEST_F(LightProcessTest, BadTablesAreRefusedByName) {
  const struct {
    const char *from, *to, *message;
  } cases[] = {
      {"white_paint", "whit_paint",
       "detectability.table.materials[0].part_material is \"whit_paint\", but the part has only "
       "\"black_rubber\", \"white_paint\""},
      {"[0.08]", "[0]", "detectability.table.materials[1].shortest_exposure_time_s[0] is 0"},
      {"\"max_exposure_time_s\": 0.01", "\"max_exposure_time_s\": 1e-6",
       "the shortest permitted exposure, 0.00001 s, is longer than the longest, 1e-06 s"},
      {"\"table\"", "\"tabel\"", "tabel"},
  };
  for (const auto& bad : cases) {
    Write("inspection.json", absl::StrReplaceAll(kLightInspection, {{bad.from, bad.to}}));
    const auto [code, output] =
        Run("evaluate inspection.json hand.json --out out --no-pictures 2>&1");
    EXPECT_EQ(code, 2) << output;
    EXPECT_THAT(output, HasSubstr("inspection.json: "));
    EXPECT_THAT(output, HasSubstr(bad.message));
  }
  Write("inspection.json", R"({"part": {"file": "box.obj", "unit": "mm"}, "detectability": {}})");
  const auto [code, output] = Run("evaluate inspection.json hand.json --out out 2>&1");
  EXPECT_EQ(code, 2);
  EXPECT_THAT(output,
              HasSubstr("camera.sensor is missing: detectability without a table needs it"));
}

// The render worker computes the table once; matt aluminium stands in for the rubber.
TEST_F(LightProcessTest, TablesAreComputedAndKept) {
  Write("inspection.json", R"({
  "name": "box", "part": {"file": "box.obj", "unit": "mm"},
  "rig": {"part_holding": "PART_HOLDING_FREE"},
  "camera": {"sensor": {"sensor_type": "mono", "pixel_pitch_m": 5.3e-6, "sensor_columns_px": 1280,
    "sensor_rows_px": 1024, "bit_depth_bit": 12, "quantum_efficiency": {"mono": 0.53},
    "gain_dn_per_electron": 0.4, "saturation_capacity_electrons": 9900,
    "dark_mean_electrons": 20, "dark_noise_electrons": 6, "max_exposure_time_s": 0.02}},
  "lens": {"focal_length_m": 0.016, "f_number": 8},
  "laser": {"distance_m": 0.5, "power_w": 0.005},
  "measurement": {"camera_distance_m": {"fixed": 0.4}, "part_alpha_deg": {"fixed": 0},
                  "part_beta_deg": {"fixed": 0}},
  "targets": {"spacing_m": 0.004}, "detectability": {},
  "materials": [{"part_material": "white_paint",
                 "material": {"name": "soot", "lambert": {"diffuse_albedo": 1e-5}}}]
})");
  const std::string command = "evaluate inspection.json hand.json --out out --no-pictures 2>&1";
  const std::string cache = absl::StrCat("XDG_CACHE_HOME=", folder_, "/cache ");
  const auto run = [&] {
    const ProcessResult result = RunProcess(
        absl::StrCat("cd ", folder_, " && ", cache, BinFolder(), "/sightline ", command));
    return std::pair(result.exit_code, result.output);
  };
  const auto [code, output] = run();
  ASSERT_EQ(code, 0) << output;
  EXPECT_THAT(output, HasSubstr("light: exposures of 0.01 ms to 20 ms are permitted"));
  EXPECT_THAT(output,
              HasSubstr("no material is given for \"black_rubber\"; matt aluminium is assumed"));
  const auto first = Read<v1::Plan>("out/plan.json");
  ASSERT_EQ(first.part_remarks_size(), 1);
  EXPECT_THAT(first.part_remarks(0), HasSubstr("matt aluminium"));
  // Soot under 5 mW needs seconds.
  bool dark = false;
  for (const v1::UncoveredCount& count : first.coverage().uncovered()) {
    dark = dark || count.reason() == v1::UNCOVERED_REASON_TOO_DARK;
  }
  EXPECT_TRUE(dark);
  int tables = 0;
  for (const auto& entry :
       std::filesystem::directory_iterator(folder_ + "/cache/sightline/detectability")) {
    tables += entry.path().extension() == ".table";
  }
  EXPECT_EQ(tables, 1);
  const auto [again, said] = run();
  ASSERT_EQ(again, 0) << said;
  const auto second = Read<v1::Plan>("out/plan.json");
  EXPECT_EQ(second.coverage().SerializeAsString(), first.coverage().SerializeAsString());
}

}  // namespace
}  // namespace sightline
