// SPDX-License-Identifier: Apache-2.0
// Verdicts on two boxes whose points are made by hand.
#include "planner_client/inspect/judge_measured.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/part/load_part.h"
#include "core/physics/angle.h"
#include "planner_client/inspect/measured_csv.h"
#include "tests/core/registration/measured_shapes.h"

namespace sightline {
namespace {

using Decision = v1::InspectedFeature;

// Targets of a feature that have to be known better.
int64_t NeededCount(const JudgedInspection& judged, size_t feature) {
  return std::count_if(judged.needed[feature].begin(), judged.needed[feature].end(),
                       [](const NeededUncertainty& needed) { return needed.uncertainty_m > 0; });
}

class JudgeMeasuredTest : public testing::Test {
 protected:
  JudgeMeasuredTest()
      : folder_(std::filesystem::temp_directory_path() /
                absl::StrCat("judge_measured_", getpid(), "_",
                             testing::UnitTest::GetInstance()->current_test_info()->name())),
        model_(StepPart()) {
    std::filesystem::create_directories(folder_);
    inspection_.targets.spacing_m = 0.004;
    inspection_.uncertainty.emplace();
    inspection_.uncertainty->detection.standard_deviations_px = {0.1};
    inspection_.uncertainty->prior_standard_deviation_m = 0.001;
    inspection_.uncertainty->resolution_m = 0.006;
    inspection_.tolerances.emplace();
    inspection_.tolerances->zone_width_m = std::nullopt;
    AddRegion("large top", {0.034, 0.004, 0.029}, {0.076, 0.056, 0.031}, 4e-4);
    AddRegion("small top", {0.004, 0.004, 0.049}, {0.026, 0.041, 0.051}, 4e-4);
    pose_.centre_m = model_.BoundingBox().center();
    pose_.parameters << 0.5 * kRadPerDeg, 0.3 * kRadPerDeg, -0.4 * kRadPerDeg, 1e-3, -8e-4, 5e-4;
    scan_.camera_distance_m = 0.3;
    scan_.triangulation_angle_rad = 0.5;
  }
  ~JudgeMeasuredTest() override { std::filesystem::remove_all(folder_); }

  void AddRegion(const char* name, const Eigen::Vector3d& low, const Eigen::Vector3d& high,
                 double width_m) {
    TolerancedRegion region;
    region.name = name;
    region.zone_width_m = width_m;
    region.box_m = Eigen::AlignedBox3d(low, high);
    inspection_.tolerances->regions.push_back(region);
  }
  // `deviation`: of the true surface along the model's normal.
  std::string Scan(const std::function<double(const Eigen::Vector3d&)>& deviation,
                   const std::function<bool(const Eigen::Vector3d&)>& kept) {
    CounterRandom random(7, 0);
    const SurfaceSample sample = SampleSurface(model_, 150'000, random);
    std::vector<Eigen::Vector3f> positions, normals;
    for (size_t i = 0; i < sample.positions_m.size(); ++i) {
      const Eigen::Vector3d& p = sample.positions_m[i];
      if (!kept(p)) continue;
      const double off_m = deviation(p) + 1e-5 * random.Normal();
      positions.push_back((pose_.Matrix() * (p + off_m * sample.normals[i])).cast<float>());
      normals.push_back((pose_.Rotation() * sample.normals[i]).cast<float>());
    }
    const std::string path = (folder_ / "scan_01.ply").string();
    EXPECT_TRUE(WritePlyPoints(path, positions, normals).ok());
    return path;
  }
  JudgedInspection Judge(const std::string& path,
                         const std::optional<ToleranceReport>& report = std::nullopt,
                         const std::vector<FaceTriangles>& faces = {}) {
    const auto part = FindMeasuredPart(model_, inspection_, {{path, 0}}, {scan_}, {});
    EXPECT_TRUE(part.ok()) << part.status();
    if (!part.ok()) return {};
    const auto requirements = MakeRequirements(inspection_, model_, report, faces);
    EXPECT_TRUE(requirements.ok()) << requirements.status();
    const auto surface = EstimateSurface(model_, inspection_, *part);
    EXPECT_TRUE(surface.ok()) << surface.status();
    if (!surface.ok() || !requirements.ok()) return {};
    const std::vector<Measurement> scans = {scan_};
    return JudgeMeasured(inspection_, *requirements, *part, scans, *surface);
  }
  static double Nothing(const Eigen::Vector3d&) { return 0; }
  static bool All(const Eigen::Vector3d&) { return true; }

  std::filesystem::path folder_;
  TriangleMesh model_;
  Inspection inspection_;
  PartPose pose_;
  Measurement scan_;
};

TEST_F(JudgeMeasuredTest, AGoodPartConforms) {
  const JudgedInspection judged = Judge(Scan(Nothing, All));
  ASSERT_EQ(judged.result.features_size(), 2);
  for (const v1::InspectedFeature& feature : judged.result.features()) {
    EXPECT_EQ(feature.decision(), Decision::CONFORMS) << feature.because();
    EXPECT_EQ(feature.id(), feature.name());
    EXPECT_LT(feature.value_m(), 2e-4);
    EXPECT_GT(feature.expanded_uncertainty_m(), 0);
    EXPECT_EQ(feature.measured_targets(), feature.targets());
  }
  EXPECT_THAT(judged.needed, testing::Each(testing::IsEmpty()));
  ASSERT_EQ(judged.result.scans_size(), 1);
  EXPECT_EQ(judged.result.scans(0).name(), "scan_01.ply");
  EXPECT_GT(judged.result.scans(0).registration_rms_m(), 0);
}

TEST_F(JudgeMeasuredTest, ADentIsFoundWhereItIs) {
  const JudgedInspection judged = Judge(Scan(
      [](const Eigen::Vector3d& p) {
        if (std::abs(p.z() - 0.03) > 1e-6) return 0.0;
        const double r = std::hypot(p.x() - 0.055, p.y() - 0.03) / 0.006;
        return -5e-4 * std::exp(-0.5 * r * r);
      },
      All));
  ASSERT_EQ(judged.result.features_size(), 2);
  const v1::InspectedFeature& dented = judged.result.features(0);
  EXPECT_EQ(dented.decision(), Decision::DOES_NOT_CONFORM) << dented.because();
  EXPECT_NEAR(dented.smallest_deviation_m(), -5e-4, 1e-4);
  EXPECT_NEAR(dented.worst_place_m().x(), 0.055, 0.005);
  EXPECT_NEAR(dented.worst_place_m().y(), 0.03, 0.005);
  EXPECT_EQ(judged.result.features(1).decision(), Decision::CONFORMS)
      << judged.result.features(1).because();
  const std::string csv = MeasuredCsv(judged.result);
  EXPECT_NE(csv.find("DOES_NOT_CONFORM"), std::string::npos) << csv;
}

TEST_F(JudgeMeasuredTest, WhatIsNotMeasuredStaysUndecided) {
  const JudgedInspection judged =
      Judge(Scan(Nothing, [](const Eigen::Vector3d& p) { return p.x() < 0.05 || p.z() < 0.029; }));
  ASSERT_EQ(judged.result.features_size(), 2);
  const v1::InspectedFeature& half = judged.result.features(0);
  EXPECT_EQ(half.decision(), Decision::UNDECIDED) << half.because();
  EXPECT_LT(half.measured_targets(), half.targets());
  EXPECT_GT(half.targets(), 0);
  EXPECT_EQ(NeededCount(judged, 0), half.targets());
  EXPECT_THAT(judged.needed[1], testing::IsEmpty());
}

// A dent that ends just within the zone of 0.4 mm: only the targets in it need more, and the nearer
// to the limit they are, the more.
TEST_F(JudgeMeasuredTest, TheTargetsThatHoldAProfileBackNeedMore) {
  const JudgedInspection judged = Judge(Scan(
      [](const Eigen::Vector3d& p) {
        if (std::abs(p.z() - 0.03) > 1e-6) return 0.0;
        const double r = std::hypot(p.x() - 0.055, p.y() - 0.03) / 0.01;
        return -1.98e-4 * std::exp(-0.5 * r * r);
      },
      All));
  const v1::InspectedFeature& dented = judged.result.features(0);
  ASSERT_EQ(dented.decision(), Decision::UNDECIDED) << dented.because();
  const int64_t needed = NeededCount(judged, 0);
  EXPECT_GT(needed, 0);
  EXPECT_LT(needed, dented.targets() / 2);
}

// Flatness of the large top, bent like x^3: least squares leaves more than the minimum zone.
TEST_F(JudgeMeasuredTest, FormByTheMinimumZone) {
  inspection_.tolerances->regions.clear();
  inspection_.tolerances->file = "step.stp";
  FaceTriangles face{1, {}, {}};
  face.positions_m = {
      {0.034, 0.004, 0.03}, {0.076, 0.004, 0.03}, {0.076, 0.056, 0.03}, {0.034, 0.056, 0.03}};
  face.triangles = {{0, 1, 2}, {0, 2, 3}};
  ToleranceReport report;
  Tolerance& flat = report.read.emplace_back();
  flat.id = "#1";
  flat.name = "flat";
  flat.kind = ToleranceKind::kFlatness;
  flat.zone_width_m = 4e-4;
  flat.faces = {1};
  const std::string scan = Scan(
      [](const Eigen::Vector3d& p) {
        if (std::abs(p.z() - 0.03) > 1e-6) return 0.0;
        return 4e-4 * std::pow((p.x() - 0.055) / 0.021, 3);
      },
      All);
  const JudgedInspection by_gauss = Judge(scan, report, {face});
  inspection_.tolerances->association = Association::kChebyshev;
  const JudgedInspection by_zone = Judge(scan, report, {face});
  ASSERT_EQ(by_gauss.result.features_size(), 1);
  ASSERT_EQ(by_zone.result.features_size(), 1);
  const v1::InspectedFeature& gauss = by_gauss.result.features(0);
  const v1::InspectedFeature& zone = by_zone.result.features(0);
  EXPECT_EQ(gauss.because().find("association"), std::string::npos);
  EXPECT_NE(zone.because().find("association: minimum zone (CHEBYSHEV)"), std::string::npos)
      << zone.because();
  // Half the height of x^3, which targets near the border do not reach in full; and noise.
  EXPECT_NEAR(zone.value_m(), 2e-4, 3e-5);
  EXPECT_LT(zone.value_m(), 0.9 * gauss.value_m());
  EXPECT_GT(zone.expanded_uncertainty_m(), 0);
}

}  // namespace
}  // namespace sightline
