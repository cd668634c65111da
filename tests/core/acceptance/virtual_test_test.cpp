// SPDX-License-Identifier: Apache-2.0
#include "core/acceptance/virtual_test.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <set>
#include <utility>

#include "core/laser_line/line_quality.h"
#include "core/physics/angle.h"

namespace sightline {
namespace {

using Eigen::Vector3d;

struct Setting {
  Rig rig;
  ScanGeometry geometry;
  SightLimits limits;
};

Setting MakeSetting() {
  Setting s;
  s.rig.camera.columns_px = 640;
  s.rig.camera.rows_px = 512;
  s.rig.camera.vertical_fov_rad = 19 * kRadPerDeg;
  Measurement place;
  place.camera_distance_m = 0.4;
  place.triangulation_angle_rad = 30 * kRadPerDeg;
  place.camera_polar_rad = 15 * kRadPerDeg;
  s.geometry = MakeScanGeometry(s.rig, place);
  s.limits.most_points = 1000;
  return s;
}

UncertaintyModel ModelOf(const TriangulationStandardDeviations& deviations, double detection_px) {
  UncertaintyModel model;
  model.calibration = MakeTriangulationCovariance(deviations);
  model.calibration.topLeftCorner<2, 2>().setZero();
  model.detection.standard_deviations_px = {detection_px};
  return model;
}

std::vector<Artefact> AllArtefacts(const Setting& s) {
  std::vector<Artefact> all = {MakeSphere(s.geometry, 0.03), MakePlate(0.08),
                               MakeRing(s.geometry, 0.04), MakeHolePattern(s.geometry, 0.05, 0.03)};
  for (Artefact& bar : MakeBallBars(s.geometry, 0.08, 0.025)) all.push_back(std::move(bar));
  return all;
}

TEST(ArtefactScan, HasPointsOnTheSurfaceWhereTheSheetMeetsIt) {
  const Setting s = MakeSetting();
  for (const Artefact& artefact : AllArtefacts(s)) {
    const ArtefactScan scan = ScanArtefact(s.rig, s.geometry, artefact, s.limits);
    ASSERT_GT(scan.points.size(), 300U) << artefact.name;
    for (const ArtefactPoint& p : scan.points) {
      const NominalSurface& surface = artefact.surfaces[static_cast<size_t>(p.surface)].nominal;
      const Vector3d again = Triangulate(scan.frames[static_cast<size_t>(p.frame)].setup,
                                         Eigen::Vector2d(p.column_px, p.row_px));
      ASSERT_NEAR((again - p.position_m).norm(), 0, 1e-9) << artefact.name;
      ASSERT_NEAR(SignedDistance(surface, p.position_m), 0, 1e-9) << artefact.name;
      ASSERT_LE(p.incidence_rad, s.limits.most_incidence_rad + 1e-9);
    }
  }
}

TEST(ArtefactScan, SeesNoWallBehindTheRimOfABore) {
  const Setting s = MakeSetting();
  const Artefact ring = MakeRing(s.geometry, 0.04);
  const ArtefactSurface& bore = ring.surfaces.front();
  const Vector3d middle = bore.reference_m;  // of the wall that faces the sensors
  EXPECT_TRUE(IsSeen(bore, middle, s.geometry.camera.origin_m, 80 * kRadPerDeg));
  // Along the wall's normal the line of sight ends on the opposite wall.
  EXPECT_FALSE(
      IsSeen(bore, middle, bore.nominal.point_m + 0.5 * AirNormal(bore, middle), 80 * kRadPerDeg));
}

TEST(SimulateTests, MeasuresExactlyWithoutErrors) {
  const Setting s = MakeSetting();
  for (const Artefact& artefact : AllArtefacts(s)) {
    const ArtefactScan scan = ScanArtefact(s.rig, s.geometry, artefact, s.limits);
    const SimulatedErrors errors =
        SimulateTests(scan, artefact, ModelOf({.focal_length_px = 0}, 0), nullptr, 2, 1);
    for (const std::vector<double>& quantity : errors) {
      ASSERT_EQ(quantity.size(), 2U) << artefact.name;
      EXPECT_LT(Magnitude95(quantity), 1e-8) << artefact.name;
    }
  }
}

// The 95 % quantile of 150 normal errors has a relative standard error of 8 %.
TEST(SimulateTests, AgreesWithThePrediction) {
  const Setting s = MakeSetting();
  const UncertaintyModel model = ModelOf({.camera_rotation_rad = 4e-5,
                                          .camera_position_m = 1e-5,
                                          .laser_tilt_rad = 4e-5,
                                          .laser_offset_m = 1e-5,
                                          .focal_length_px = 0.3,
                                          .principal_point_px = 0.1},
                                         0.1);
  for (const Artefact& artefact : AllArtefacts(s)) {
    const ArtefactScan scan = ScanArtefact(s.rig, s.geometry, artefact, s.limits);
    const SimulatedErrors errors = SimulateTests(scan, artefact, model, nullptr, 150, 1);
    const auto predicted = PredictTests(scan, artefact, model, 150, 2);
    ASSERT_EQ(errors.size(), predicted.size());
    for (size_t q = 0; q < errors.size(); ++q) {
      EXPECT_NEAR(Magnitude95(errors[q]) / predicted[q].magnitude_m, 1, 0.25)
          << artefact.name << ", quantity " << q;
    }
  }
}

// Joining the set-ups takes off a displacement of all bores alike, such as by a shift of the
// sensors, but no growth of their distance.
TEST(HolePattern, JoiningTakesOffWhatAllBoresShare) {
  const Setting s = MakeSetting();
  const Artefact pattern = MakeHolePattern(s.geometry, 0.05, 0.03);
  const Vector3d across =
      (pattern.surfaces[2].nominal.point_m - pattern.surfaces[0].nominal.point_m);
  EXPECT_NEAR(across.norm(), 0.05 * std::numbers::sqrt2, 1e-12);
  EXPECT_NEAR(across.dot(pattern.surfaces[0].nominal.axis), 0, 1e-12);
  const HolePatternWeights weights = WeightsOfHolePattern(pattern);
  for (const auto& setup : weights.all) {
    Vector3d sum = Vector3d::Zero();
    for (const Vector3d& weight : setup) sum += weight;
    EXPECT_LT(sum.norm(), 1e-12);
  }
  // Bore 0 lies at place 0 of the first set-up, bore 2 at place 0 of the second. A scale error
  // moves both outwards, and the distance grows by all of it.
  double growth = 0;
  for (size_t setup = 0; setup < 2; ++setup) {
    for (size_t place = 0; place < 4; ++place) {
      growth += weights.all[setup][place].dot(pattern.surfaces[place].nominal.point_m);
    }
  }
  EXPECT_NEAR(growth, across.norm(), 1e-12);
}

// A wrong focal length scales lengths along the line: dL = L df / f.
TEST(PredictTests, ScalesABallBarWithTheFocalLength) {
  const Setting s = MakeSetting();
  constexpr double kLength_m = 0.08, kError_px = 1;
  const Artefact bar = MakeBallBars(s.geometry, kLength_m, 0.02)[0];
  const ArtefactScan scan = ScanArtefact(s.rig, s.geometry, bar, s.limits);
  const auto predicted = PredictTests(scan, bar, ModelOf({.focal_length_px = kError_px}, 0), 20, 1);
  const double by_hand_m = kNormal95 * kLength_m * kError_px / s.rig.camera.FocalLengthPx();
  EXPECT_NEAR(predicted.at(0).magnitude_m / by_hand_m, 1, 0.05);
}

// Lines that differ by chance leave the standard error of their mean, lines that agree nothing.
TEST(ChanceOfRenderedLines, IsTheStandardErrorOfTheirMean) {
  const Setting s = MakeSetting();
  const Artefact sphere = MakeSphere(s.geometry, 0.03);
  const ArtefactScan scan = ScanArtefact(s.rig, s.geometry, sphere, s.limits);
  const auto lines = [](const std::vector<float>& shifts_px) {
    LineDeviations::Frame frame{0, -1000, {}};
    for (const float shift_px : shifts_px) {
      frame.realisations.push_back({std::vector<float>(2000, shift_px)});
    }
    return LineDeviations({frame}, false);
  };
  const auto chance = [&](const std::vector<float>& shifts_px) {
    const auto all = ChanceOfRenderedLines(scan, sphere, lines(shifts_px));
    EXPECT_EQ(all.size(), 3U);
    EXPECT_EQ(all.at(1), 0);
    return all.at(0);
  };
  EXPECT_NEAR(chance({0.3F, 0.3F, 0.3F}), 0, 1e-12);
  EXPECT_EQ(chance({0.3F}), 0);
  // Shifts of -1 and 1 px: the standard error is that of 1 px, whose effect is linear.
  const double by_1_px = SystematicContributions(scan, sphere, lines({1}))[0];
  EXPECT_GT(by_1_px, 1e-6);
  EXPECT_NEAR(chance({-1, 1}) / by_1_px, 1, 1e-6);
  EXPECT_NEAR(chance({-1, 1, -1, 1}) / by_1_px, 1 / std::sqrt(3.0), 1e-6);
}

// Independent noise along the normals: half of a range that holds 95 % is 1.96 standard deviations.
TEST(PredictTests, FindsTheFormErrorOfNoise) {
  const Setting s = MakeSetting();
  const Artefact plate = MakePlate(0.08);
  const ArtefactScan scan = ScanArtefact(s.rig, s.geometry, plate, s.limits);
  const auto predicted = PredictTests(scan, plate, ModelOf({.focal_length_px = 0}, 0.1), 100, 1);
  const double noise_m = predicted.at(0).terms.at(0).contribution_m;
  EXPECT_EQ(predicted[0].terms[0].name, "line detection");
  EXPECT_NEAR(predicted[0].magnitude_m / (2 * kNormal95 * noise_m), 1, 0.1);
  EXPECT_GT(predicted.at(1).magnitude_m, predicted[0].magnitude_m);
}

TEST(LineDeviations, AreThoseOfTheNearestFrame) {
  constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
  const std::vector<LineDeviations::Frame> frames = {
      {0.001, -1, {{{0.1F, 0.2F, kNone}}, {{0.3F, 0.2F, kNone}}}},
      {-0.001, -1, {{{-0.1F, 0, 0}}, {{-0.1F, 0, 0}}}}};
  const LineDeviations once(frames, false);
  EXPECT_EQ(once.realisations(), 2);
  EXPECT_NEAR(once.At(0.002, 0, 0).value(), 0.2, 1e-6);
  EXPECT_NEAR(once.At(-0.0002, -1, 0).value(), -0.1, 1e-6);
  EXPECT_FALSE(once.At(0.002, 1, 0).has_value());
  EXPECT_FALSE(once.At(0.002, 2, 0).has_value());
  EXPECT_NEAR(once.MeanAt(0.001, -1).deviation_px, 0.2, 1e-6);
  EXPECT_EQ(once.MeanAt(0.001, 1).count, 0);
  const LineDeviations repeated(frames, true);
  EXPECT_NEAR(repeated.At(0.002, 2, 1).value(), 0.3, 1e-6);
}

// A deviation of the line that is the same everywhere moves a plate and leaves it flat.
TEST(SimulateTests, TakesTheDeviationsOfImages) {
  const Setting s = MakeSetting();
  const Artefact plate = MakePlate(0.05);
  const ArtefactScan scan = ScanArtefact(s.rig, s.geometry, plate, s.limits);
  const LineDeviations shift({{0, 0, {{{0.5F, 0.5F}}}}}, true);
  // The columns that the scan uses have one sign and the other in turn, so that no tilt fits them.
  std::set<int> columns;
  for (const ArtefactPoint& point : scan.points) columns.insert(point.column_px);
  const int first = *columns.begin();
  LineDeviations::Realisation signs;
  float sign = 0.5F;
  for (int column = first; column <= *columns.rbegin(); ++column) {
    if (columns.contains(column)) sign = -sign;
    signs.rows_px.push_back(sign);
  }
  const int reference = PlaceOfReference(scan, plate.surfaces[0]).column_px;
  const LineDeviations ripple({{0, first - reference, {signs}}}, true);
  const UncertaintyModel model = ModelOf({.focal_length_px = 0}, 0);
  const double shifted_m = SimulateTests(scan, plate, model, &shift, 2, 1)[0].at(0);
  const double rippled_m = SimulateTests(scan, plate, model, &ripple, 2, 1)[0].at(0);
  // A pixel is worth more where the plate is farther from the camera.
  double least_m = std::numeric_limits<double>::infinity(), px_m = 0;
  for (const ArtefactPoint& point : scan.points) {
    least_m = std::min(least_m, std::abs(point.slope_m_per_px));
    px_m = std::max(px_m, std::abs(point.slope_m_per_px));
  }
  EXPECT_LT(shifted_m, 0.02 * px_m);
  EXPECT_GT(rippled_m, 0.98 * least_m);
  EXPECT_LT(rippled_m, 1.02 * px_m);
  EXPECT_LT(SystematicContributions(scan, plate, shift).at(0), 0.02 * px_m);
}

TEST(NarrowestRange, LeavesOutTheFarValues) {
  std::vector<double> values;
  for (int i = 0; i < 100; ++i) values.push_back(i);
  values.back() = 1000;
  EXPECT_EQ(NarrowestRange(values, 0.95), 94);
  EXPECT_EQ(NarrowestRange(values, 1), 1000);
}

}  // namespace
}  // namespace sightline
