// SPDX-License-Identifier: Apache-2.0
// `sightline plan`, `evaluate` and `compare` for uncertainty as processes, with the server they
// start.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numbers>
#include <string>
#include <vector>

#include "absl/strings/str_format.h"
#include "absl/strings/str_replace.h"
#include "core/inspection/inspection.h"
#include "core/json/strict_json.h"
#include "core/part/load_part.h"
#include "core/rig/scan_geometry.h"
#include "sightline/v1/plan.pb.h"
#include "tests/integration/planning/box_process.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;

// Its top is toleranced, by hand.
constexpr char kInspection[] = R"({
  "name": "box", "part": {"file": "box.obj", "unit": "mm"},
  "rig": {"part_holding": "PART_HOLDING_FREE"},
  "uncertainty": {"line_detection": {"standard_deviation_px": 0.1}, "calibration": {},
    "registration": "NONE"},
  "tolerances": {"regions": [{"name": "top", "zone_width_m": 0.0002,
    "min_m": {"x": -1, "y": -1, "z": 0.0199}, "max_m": {"x": 1, "y": 1, "z": 1}}]},
  "targets": {"spacing_m": 0.002},
  "goal": {"admissible": 0.8}
})";

class PlanProcessTest : public BoxProcessTest {
 protected:
  PlanProcessTest() : BoxProcessTest(kInspection) {}

  // Angles between the laser sheet and the lines of sight to the points that a scan measures [deg],
  // ascending, from its point cloud and its measurement.
  std::vector<double> TriangulationAngles(const std::string& points, const v1::PlannedScan& scan) {
    const auto inspection = ReadInspection(folder_ + "/inspection.json");
    const auto cloud = LoadPoints(folder_ + "/" + points);
    if (!inspection.ok() || !cloud.ok()) return {};
    const ScanGeometry geometry =
        MakeScanGeometry(inspection->rig, MeasurementFromProto(scan.measurement()));
    const Eigen::Vector3d centre_m(0.03, 0.02, 0.01);  // of the box
    std::vector<double> angles_deg;
    for (const Eigen::Vector3d& point : cloud->positions_m) {
      const double lit_m = geometry.LitStagePosition(PartToWorld(geometry, centre_m, point, 0));
      const Eigen::Vector3d sight =
          (PartToWorld(geometry, centre_m, point, lit_m) - geometry.camera.origin_m).normalized();
      angles_deg.push_back(std::asin(std::abs(sight.dot(geometry.sheet_normal))) * 180 /
                           std::numbers::pi);
    }
    std::sort(angles_deg.begin(), angles_deg.end());
    return angles_deg;
  }
};

TEST_F(PlanProcessTest, SetUpsAreJoinedAndTheirErrorsCount) {
  const std::string exact = Bytes("inspection.json");
  const std::string options =
      " --evaluations-per-scan 300 --bound-evaluations 0 --no-pictures --field-directions 576";
  ASSERT_EQ(Run("plan inspection.json --out exact" + options).first, 0);
  const v1::Plan plan = Read<v1::Plan>("exact/plan.json");
  EXPECT_THAT(plan.uncertainty().registration(), HasSubstr("taken as exact"));
  EXPECT_THAT(plan.uncertainty().calibration(), HasSubstr("not counted"));
  const auto evaluate = [&](const std::string& registration) {
    Write("joined.json", absl::StrReplaceAll(exact, {{R"("registration": "NONE")", registration}}));
    const auto [code, output] = Run("evaluate joined.json exact/plan.json --out joined");
    EXPECT_EQ(code, 0) << output;
    return Read<v1::Plan>("joined/plan.json");
  };
  const v1::Plan known = evaluate(
      R"("registration": "KNOWN_POSES", "registration_position_m": 3e-5, "registration_angle_deg": 0)");
  const v1::FeatureVerdict& before = plan.uncertainty().features(0);
  const v1::FeatureVerdict& after = known.uncertainty().features(0);
  EXPECT_EQ(before.registration_m(), 0);
  EXPECT_GT(after.registration_m(), 1e-5);
  EXPECT_NEAR(std::hypot(std::hypot(after.noise_m(), after.sampling_m()), after.calibration_m(),
                         after.registration_m()),
              after.uncertainty_m(), 1e-9);
  EXPECT_LT(known.uncertainty().admissible_fraction(), plan.uncertainty().admissible_fraction());
  for (const v1::Setup& setup : known.setups()) {
    EXPECT_NEAR(setup.registration().standard_uncertainty_m(), 3e-5, 1e-9);
  }
  // Two places of the sensors. The box is placed by hand to 2 mm; what both see joins them far
  // better.
  v1::Plan two = plan;
  *two.add_scans() = two.scans(0);
  v1::Measurement& moved = *two.mutable_scans(two.scans_size() - 1)->mutable_measurement();
  moved.set_camera_distance_m(moved.camera_distance_m() + 0.01);
  Write("exact/plan.json", ToJson(two));
  const v1::Plan joined = evaluate(R"("registration": "BEST_FIT")");
  EXPECT_THAT(joined.uncertainty().registration(), HasSubstr("by best fit"));
  EXPECT_GE(joined.setups_size(), 2);
  for (const v1::Setup& setup : joined.setups()) {
    EXPECT_GT(setup.registration().overlap_targets(), 0);
    EXPECT_LT(setup.registration().standard_uncertainty_m(), 2e-3);
  }
  // A bound for stricter requirements than those of the drawing is none.
  ASSERT_EQ(Run("plan joined.json --out bounded --evaluations-per-scan 100 --bound-evaluations 500 "
                "--no-pictures --field-directions 576")
                .first,
            0);
  const v1::ScanCountBound bound = Read<v1::Plan>("bounded/plan.json").uncertainty().bound();
  EXPECT_FALSE(bound.converged());
  EXPECT_THAT(bound.statement(), HasSubstr("a plan with fewer scans is possible"));
  Write("wrong.json", absl::StrReplaceAll(exact, {{R"("NONE")", R"("KNOWN_POSES")"}}));
  const auto [code, output] = Run("plan wrong.json --out wrong");
  EXPECT_EQ(code, 2);
  EXPECT_THAT(output, HasSubstr("uncertainty.registration_position_m is missing"));
  Write("wrong.json", absl::StrReplaceAll(exact, {{R"("NONE")", R"("DATUM_FEATURES")"}}));
  EXPECT_THAT(Run("plan wrong.json --out wrong").second, HasSubstr("name no datum with a face"));
}

TEST_F(PlanProcessTest, PlansForATolerancedTopAndProvesIt) {
  const std::string options =
      " --evaluations-per-scan 500 --bound-evaluations 2000 --no-pictures --field-directions 576";
  const auto [code, output] = Run("plan inspection.json --out a" + options);
  ASSERT_EQ(code, 0) << output;
  const v1::Plan plan = Read<v1::Plan>("a/plan.json");
  const v1::PlanUncertainty& u = plan.uncertainty();
  // Only the top is toleranced: 24 of 88 square centimetres.
  EXPECT_GT(u.judged_targets(), 0);
  EXPECT_NEAR(static_cast<double>(u.judged_targets()) /
                  static_cast<double>(plan.coverage().measurable_targets()),
              24.0 / 88, 0.05);
  EXPECT_GE(u.admissible_fraction(), 0.8);
  EXPECT_GE(u.fresh_admissible_fraction(), 0.8);
  EXPECT_GE(u.relaxed_fraction(), u.admissible_fraction());
  EXPECT_GE(u.bound().scans(), 0.5);
  EXPECT_LE(u.bound().scans(), plan.scans_size() + 1e-6);
  EXPECT_EQ(plan.scans(plan.scans_size() - 1).cumulative_admissible_targets(),
            std::llround(u.admissible_fraction() * u.judged_targets()));
  EXPECT_GT(u.examined_points(), 0);
  EXPECT_EQ(u.second_order_points(), 0);  // 0.1 px is nothing
  ASSERT_EQ(u.features_size(), 1);
  EXPECT_EQ(u.features(0).name(), "top");
  EXPECT_EQ(u.features(0).targets(), u.judged_targets());
  EXPECT_FALSE(u.features(0).because().empty());
  for (const char* file : {"a/report.html", "a/setup.html", "a/uncertainty.ply", "a/plan.qif"}) {
    EXPECT_TRUE(fs::exists(folder_ + "/" + file)) << file;
  }

  // Same seed, same bytes; and the same numbers when the plan is evaluated.
  ASSERT_EQ(Run("plan inspection.json --out b" + options).first, 0);
  EXPECT_EQ(Bytes("a/plan.json"), Bytes("b/plan.json"));
  EXPECT_EQ(Bytes("a/uncertainty.ply"), Bytes("b/uncertainty.ply"));
  const auto [evaluated, said] = Run("evaluate inspection.json a/plan.json --out c --ellipsoids");
  ASSERT_EQ(evaluated, 0) << said;
  EXPECT_EQ(Read<v1::Plan>("c/plan.json").uncertainty().admissible_fraction(),
            u.admissible_fraction());
  EXPECT_TRUE(fs::exists(folder_ + "/c/points/scan_01_ellipsoids.ply"));

  // How finely each scan measures, against its points.
  const v1::Plan evaluated_plan = Read<v1::Plan>("c/plan.json");
  for (int i = 0; i < plan.scans_size(); ++i) {
    const v1::ScanQuality& quality = plan.scans(i).quality();
    const std::vector<double> angles_deg = TriangulationAngles(
        absl::StrFormat("a/points/scan_%02d.ply", plan.scans(i).index()), plan.scans(i));
    ASSERT_GT(angles_deg.size(), 1000);
    const auto quantile = [&](double q) {
      return angles_deg[static_cast<size_t>(q * static_cast<double>(angles_deg.size() - 1))];
    };
    EXPECT_NEAR(quality.triangulation_angle_deg().low(), quantile(0.025), 0.05);
    EXPECT_NEAR(quality.triangulation_angle_deg().median(), quantile(0.5), 0.05);
    EXPECT_NEAR(quality.triangulation_angle_deg().high(), quantile(0.975), 0.05);
    EXPECT_GE(quality.depth_per_pixel_m().low(), quality.pixel_footprint_m().low());
    EXPECT_LE(quality.overlap(), 1);
    // Angles go through degrees in between.
    const v1::ScanQuality& again = evaluated_plan.scans(i).quality();
    EXPECT_NEAR(again.depth_per_pixel_m().median(), quality.depth_per_pixel_m().median(), 1e-12);
    EXPECT_NEAR(again.laser_incidence_deg().high(), quality.laser_incidence_deg().high(), 1e-9);
    EXPECT_EQ(again.overlap(), quality.overlap());
  }
  EXPECT_THAT(Bytes("a/report.html"), AllOf(HasSubstr("How finely each scan measures"),
                                            HasSubstr("\"link\":\"setup.html\"")));
  const ProcessResult exports =
      RunProcess(absl::StrCat("/usr/bin/python3 -B ", SIGHTLINE_READ_EXPORTS, " ", folder_, "/a"));
  EXPECT_EQ(exports.exit_code, 0) << exports.output;
}

// A service plans with a checkpoint, the command without one: their plans are the same.
TEST_F(PlanProcessTest, KeptAnswersGiveTheSameBytesAndAreOfTheSameQuestion) {
  const std::string options =
      "plan inspection.json --evaluations-per-scan 300 --bound-evaluations 1000 --no-pictures "
      "--no-point-clouds --field-directions 576 --out ";
  ASSERT_EQ(Run(options + "without").first, 0);
  const std::string plan = Bytes("without/plan.json");
  const auto run = [&](const std::string& what) {
    const auto [code, output] = Run(options + "kept --checkpoint answers");
    EXPECT_EQ(code, 0) << output;
    EXPECT_EQ(Bytes("kept/plan.json"), plan) << what;
    const size_t at = output.find("checkpoint: ");
    return at == std::string::npos ? "" : output.substr(at);
  };
  EXPECT_EQ(run("answers are asked"), "");
  EXPECT_EQ(run("answers are replayed"), "");

  // The mesh is the same, the file is not.
  Write("box.obj", "# again\n" + Bytes("box.obj"));
  EXPECT_THAT(run("another file"), HasSubstr("answers belong to another task"));
  EXPECT_EQ(run("the other file again"), "");

  std::string damaged = Bytes("answers/answers");
  damaged.replace(damaged.size() / 2, 64, std::string(64, 'Z'));
  Write("answers/answers", damaged);
  EXPECT_THAT(run("a damaged answer"),
              AllOf(HasSubstr("answers/answers: answer "), HasSubstr("evaluated again")));
  EXPECT_EQ(run("a mended answer"), "");
}

TEST_F(PlanProcessTest, ComparesGainFunctions) {
  const auto [code, output] =
      Run("compare inspection.json --out d --strategies greedy-pso-1 --gains ra:0.4,tu,own "
          "--seeds 1 --evaluations-per-scan 300");
  ASSERT_EQ(code, 0) << output;
  const std::string curves = Bytes("d/curves.csv");
  for (const char* name :
       {"greedy-pso-1 ra:0.4,1,1,", "greedy-pso-1 tu,1,1,", "greedy-pso-1 own,1,1,"}) {
    EXPECT_THAT(curves, HasSubstr(name));
  }
  EXPECT_THAT(Run("compare inspection.json --out d --gains ra:2").second,
              HasSubstr("\"ra:2\" is none of ra:ALPHA"));
}

}  // namespace
}  // namespace sightline
