// SPDX-License-Identifier: Apache-2.0
// `sightline inspect` as a process: points of a plan's scans to verdicts.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <functional>
#include <string>

#include "absl/strings/str_cat.h"
#include "core/part/load_part.h"
#include "sightline/v1/measured_result.pb.h"
#include "sightline/v1/plan.pb.h"
#include "tests/integration/planning/box_process.h"

namespace sightline {
namespace {

using ::testing::HasSubstr;
using Decision = v1::InspectedFeature;

constexpr char kToleranced[] = R"({
  "name": "box", "part": {"file": "box.obj", "unit": "mm"},
  "rig": {"part_holding": "PART_HOLDING_FREE"},
  "uncertainty": {"line_detection": {"standard_deviation_px": 0.05},
                  "prior_standard_deviation_m": 0.001,
                  "calibration": {}, "registration": "NONE"},
  "tolerances": {"regions": [{"name": "top", "zone_width_m": 0.0004,
    "min_m": {"x": 0.005, "y": 0.005, "z": 0.0199}, "max_m": {"x": 0.055, "y": 0.035, "z": 1}}]},
  "targets": {"spacing_m": 0.003},
  "goal": {"admissible": 0.97}
})";

class InspectProcessTest : public BoxProcessTest {
 protected:
  InspectProcessTest() : BoxProcessTest(kToleranced) {}

  void SetUp() override {
    BoxProcessTest::SetUp();
    const auto [code, output] =
        Run("plan inspection.json --out plan --evaluations-per-scan 500 --bound-evaluations 0 "
            "--no-pictures --field-directions 576");
    ASSERT_EQ(code, 0) << output;
    scans_ = Read<v1::Plan>("plan/plan.json").scans_size();
    std::filesystem::create_directories(folder_ + "/real");
  }
  // Copies the points of the plan's scans, moved along their normals by what `off` says, and
  // returns the options that name them.
  std::string Measure(const std::function<double(const Eigen::Vector3d&)>& off) const {
    std::string options;
    for (int k = 1; k <= scans_; ++k) {
      const std::string name = absl::StrCat("scan_0", k, ".ply");
      const auto cloud = LoadPoints(absl::StrCat(folder_, "/plan/points/", name));
      EXPECT_TRUE(cloud.ok()) << cloud.status();
      if (!cloud.ok()) return "";
      std::vector<Eigen::Vector3f> positions, normals;
      for (size_t i = 0; i < cloud->positions_m.size(); ++i) {
        const Eigen::Vector3d& p = cloud->positions_m[i];
        positions.push_back((p + off(p) * cloud->normals[i]).cast<float>());
        normals.push_back(cloud->normals[i].cast<float>());
      }
      EXPECT_TRUE(WritePlyPoints(absl::StrCat(folder_, "/real/", name), positions, normals).ok());
      absl::StrAppend(&options, " --measured real/", name);
    }
    return options;
  }

  int scans_ = 0;
};

TEST_F(InspectProcessTest, AGoodPartConformsAndADentIsFound) {
  const std::string good = Measure([](const Eigen::Vector3d&) { return 0; });
  const std::string command = "inspect inspection.json --plan plan/plan.json --out verdict";
  const auto [code, output] = Run(command + good + " --fail-on undecided");
  EXPECT_EQ(code, 0) << output;
  const auto result = Read<v1::InspectionResult>("verdict/measured.json");
  ASSERT_EQ(result.features_size(), 1);
  EXPECT_EQ(result.features(0).decision(), Decision::CONFORMS) << output;
  EXPECT_EQ(result.scans_size(), scans_);
  for (const char* file : {"report.html", "measured.csv", "results.qif"}) {
    EXPECT_TRUE(std::filesystem::exists(absl::StrCat(folder_, "/verdict/", file))) << file;
  }
  EXPECT_THAT(output, HasSubstr("CONFORMS"));
  EXPECT_THAT(Bytes("verdict/results.qif"), HasSubstr(">PASS<"));

  const std::string dented = Measure([](const Eigen::Vector3d& p) {
    const double r = std::hypot(p.x() - 0.03, p.y() - 0.02) / 0.005;
    return p.z() > 0.0199 ? -8e-4 * std::exp(-0.5 * r * r) : 0;
  });
  EXPECT_EQ(Run(command + dented).first, 0);
  EXPECT_EQ(Run(command + dented + " --fail-on does-not-conform").first, 1);
  const auto found = Read<v1::InspectionResult>("verdict/measured.json").features(0);
  EXPECT_EQ(found.decision(), Decision::DOES_NOT_CONFORM) << found.because();
  EXPECT_NEAR(found.worst_place_m().x(), 0.03, 0.004);
  EXPECT_NEAR(found.worst_place_m().y(), 0.02, 0.004);
  EXPECT_THAT(Bytes("verdict/results.qif"), HasSubstr(">FAIL<"));
}

// Half of the top is missing: the scan that shows it is planned, and decides.
TEST_F(InspectProcessTest, TheNextScanIsNamedAndDecides) {
  const std::string name = "real/scan_01.ply";
  const auto cloud = LoadPoints(folder_ + "/plan/points/scan_01.ply");
  ASSERT_TRUE(cloud.ok()) << cloud.status();
  std::vector<Eigen::Vector3f> positions, normals;
  for (size_t i = 0; i < cloud->positions_m.size(); ++i) {
    if (cloud->positions_m[i].x() > 0.03) continue;
    positions.push_back(cloud->positions_m[i].cast<float>());
    normals.push_back(cloud->normals[i].cast<float>());
  }
  ASSERT_TRUE(WritePlyPoints(folder_ + "/" + name, positions, normals).ok());
  const auto [code, output] =
      Run("inspect inspection.json --plan plan/plan.json --out verdict --evaluations-per-scan 500 "
          "--measured " +
          name);
  EXPECT_EQ(code, 0) << output;
  const auto result = Read<v1::InspectionResult>("verdict/measured.json");
  EXPECT_EQ(result.features(0).decision(), Decision::UNDECIDED) << output;
  ASSERT_TRUE(result.has_next_scan()) << output;
  EXPECT_GT(result.next_scan().settled_targets(), 0);
  EXPECT_GE(result.next_scan().open_targets(), result.next_scan().settled_targets());
  EXPECT_EQ(result.next_scan().features(0), "top");

  const auto next = Read<v1::Plan>("verdict/next_plan.json");
  ASSERT_EQ(next.scans_size(), scans_ + 1);
  EXPECT_TRUE(next.scans(0).locked());
  EXPECT_FALSE(next.scans(scans_).locked());
  const auto evaluated =
      Run("evaluate inspection.json verdict/next_plan.json --out plan_2 --no-pictures");
  ASSERT_EQ(evaluated.first, 0) << evaluated.second;
  ASSERT_EQ(Read<v1::Plan>("plan_2/plan.json").scans_size(), scans_ + 1);
  const auto decided =
      Run(absl::StrCat("inspect inspection.json --plan plan_2/plan.json --out verdict --measured ",
                       name, " --measured plan_2/points/scan_0", scans_ + 1, ".ply"));
  EXPECT_EQ(decided.first, 0) << decided.second;
  EXPECT_EQ(Read<v1::InspectionResult>("verdict/measured.json").features(0).decision(),
            Decision::CONFORMS)
      << decided.second;
  EXPECT_FALSE(std::filesystem::exists(folder_ + "/verdict/next_plan.json"));
}

TEST_F(InspectProcessTest, WrongInputIsNamed) {
  const std::string command = "inspect inspection.json --plan plan/plan.json --out verdict";
  Write("real/scan_01.e57", "x");
  const auto e57 = Run(command + " --measured real/scan_01.e57");
  EXPECT_EQ(e57.first, 2);
  EXPECT_THAT(e57.second, HasSubstr("export the points as PLY"));
  const auto none = Run(command + " --measured real/scan_01.ply");
  EXPECT_EQ(none.first, 2) << none.second;
  EXPECT_THAT(none.second, HasSubstr("real/scan_01.ply"));
  Write("bare.json", R"({"name": "bare", "part": {"file": "box.obj", "unit": "mm"}})");
  const auto bare = Run(
      "inspect bare.json --plan plan/plan.json --out verdict --measured plan/points/scan_01.ply");
  EXPECT_EQ(bare.first, 2);
  EXPECT_THAT(bare.second, HasSubstr("bare.json: has no tolerances"));
}

}  // namespace
}  // namespace sightline
