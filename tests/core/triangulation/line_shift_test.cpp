// SPDX-License-Identifier: Apache-2.0
// Shifts of the laser line against the profile of the image column, integrated numerically: rays of
// the camera meet the surface, and the laser's irradiance there times the cosine of its incidence
// is the radiance of a matt surface.
#include "core/triangulation/line_shift.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <vector>

#include "core/acceptance/artefact.h"
#include "core/acceptance/artefact_scan.h"
#include "core/association/surface_curvature.h"
#include "core/laser_line/profile_centre.h"
#include "core/physics/angle.h"
#include "tests/core/acceptance/artefact_setting.h"

namespace sightline {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

ArtefactSetting MakeShiftSetting() {
  ArtefactSetting s = MakeArtefactSetting(25 * kRadPerDeg, 200);
  s.limits.most_incidence_rad = 55 * kRadPerDeg;
  return s;
}

double Radiance(const TriangulationSetup& setup, const ArtefactSurface& surface,
                const Vector2d& image_px, double sheet_deviation_m) {
  const Vector2d k = (image_px - setup.principal_point_px) / setup.focal_length_px;
  const Vector3d sight =
      k.x() * setup.camera.x_axis + k.y() * setup.camera.y_axis + setup.camera.z_axis;
  for (const Vector3d& point_m : Crossings(surface, setup.camera.origin_m, sight)) {
    const Vector3d normal = AirNormal(surface, point_m);
    if (normal.dot(sight) > 0) continue;
    const Vector3d light = point_m - setup.laser.origin_m;
    const double q_m = setup.laser.y_axis.dot(light);
    return std::exp(-0.5 * std::pow(q_m / sheet_deviation_m, 2)) *
           std::max(0.0, -normal.dot(light.normalized()));
  }
  return 0;
}

struct MeanShifts {
  double centre_of_gravity_px = 0, gaussian_fit_px = 0;
};

// Means of predicted and of integrated shifts over the points of an artefact.
struct Comparison {
  MeanShifts predicted, integrated;
};
Comparison Compare(const ArtefactSetting& s, const Artefact& artefact, double sheet_deviation_m) {
  constexpr double kStep_px = 0.05, kReach_px = 20;
  const ArtefactScan scan = ScanArtefact(s.rig, s.geometry, artefact, s.limits);
  EXPECT_GT(scan.points.size(), 100U);
  Comparison mean;
  int count = 0;
  for (const ArtefactPoint& p : scan.points) {
    const ArtefactSurface& surface = artefact.surfaces[static_cast<size_t>(p.surface)];
    const TriangulationSetup& setup = scan.frames[static_cast<size_t>(p.frame)].setup;
    std::vector<double> profile;
    double sum = 0, moment = 0;
    for (int i = 0; i <= 2 * kReach_px / kStep_px; ++i) {
      const double away_px = i * kStep_px - kReach_px;
      profile.push_back(
          Radiance(setup, surface, Vector2d(p.column_px, p.row_px + away_px), sheet_deviation_m));
      sum += profile.back();
      moment += profile.back() * away_px;
    }
    const double half = kReach_px / kStep_px;
    const auto fit = FitGaussian(profile, {0, 2 * half, half, half}, 0);
    if (!fit) continue;
    const LineShift shift =
        LineShiftOnSurface(setup, p.position_m, p.normal,
                           DistanceHessian(surface.nominal, p.position_m), sheet_deviation_m);
    mean.predicted.centre_of_gravity_px += shift.centre_of_gravity_px;
    mean.predicted.gaussian_fit_px += shift.gaussian_fit_px;
    mean.integrated.centre_of_gravity_px += moment / sum;
    mean.integrated.gaussian_fit_px += (fit->place - half) * kStep_px;
    ++count;
  }
  for (MeanShifts* shifts : {&mean.predicted, &mean.integrated}) {
    shifts->centre_of_gravity_px /= count;
    shifts->gaussian_fit_px /= count;
  }
  return mean;
}

// The second order agrees with the integral within a tenth where the line is narrow.
TEST(LineShift, IsThatOfTheIntegratedProfileOnASphere) {
  const ArtefactSetting s = MakeShiftSetting();
  const Comparison shifts = Compare(s, MakeSphere(s.geometry, 0.02), 150e-6);
  EXPECT_GT(std::abs(shifts.integrated.centre_of_gravity_px), 1e-3);
  EXPECT_NEAR(shifts.predicted.centre_of_gravity_px / shifts.integrated.centre_of_gravity_px, 1,
              0.1);
  EXPECT_NEAR(shifts.predicted.gaussian_fit_px, shifts.integrated.gaussian_fit_px,
              0.1 * std::abs(shifts.integrated.centre_of_gravity_px));
}

// It grows with the square of the width and the curvature.
TEST(LineShift, GrowsWithTheSquareOfTheWidthAndWithTheCurvature) {
  const ArtefactSetting s = MakeShiftSetting();
  const double narrow_px =
      Compare(s, MakeSphere(s.geometry, 0.04), 100e-6).predicted.centre_of_gravity_px;
  const double wide_px =
      Compare(s, MakeSphere(s.geometry, 0.04), 200e-6).predicted.centre_of_gravity_px;
  const double curved_px =
      Compare(s, MakeSphere(s.geometry, 0.02), 100e-6).predicted.centre_of_gravity_px;
  EXPECT_NEAR(wide_px / narrow_px, 4, 0.01);
  EXPECT_NEAR(curved_px / narrow_px, 2, 0.1);
}

TEST(LineShift, IsNextToNothingOnAPlane) {
  const ArtefactSetting s = MakeShiftSetting();
  const Comparison shifts = Compare(s, MakePlate(0.05), 150e-6);
  EXPECT_LT(std::abs(shifts.predicted.centre_of_gravity_px), 2e-3);
}

TEST(DistanceHessian, AgreesWithDifferencesOfTheGradient) {
  NominalSurface s;
  s.point_m = Vector3d(0.01, -0.02, 0.005);
  s.axis = Vector3d(1, 2, 3).normalized();
  s.radius_m = 0.05;
  s.tube_radius_m = 0.01;
  s.half_angle_rad = 0.4;
  const Vector3d point_m(0.06, 0.03, 0.05);
  for (const SurfaceKind kind : {SurfaceKind::kPlane, SurfaceKind::kCylinder, SurfaceKind::kCone,
                                 SurfaceKind::kSphere, SurfaceKind::kTorus}) {
    s.kind = kind;
    const Vector3d on_surface_m =
        point_m - SignedDistance(s, point_m) * DistanceGradient(s, point_m, Vector3d::Zero());
    ASSERT_NEAR(SignedDistance(s, on_surface_m), 0, 1e-12);
    const Eigen::Matrix3d hessian = DistanceHessian(s, on_surface_m);
    constexpr double kStep_m = 1e-6;
    for (int k = 0; k < 3; ++k) {
      const Vector3d step = kStep_m * Vector3d::Unit(k);
      const Vector3d change = DistanceGradient(s, on_surface_m + step, Vector3d::Zero()) -
                              DistanceGradient(s, on_surface_m - step, Vector3d::Zero());
      EXPECT_LT((change / (2 * kStep_m) - hessian.col(k)).norm(), 1e-4 * (1 + hessian.norm()))
          << SurfaceKindName(kind);
    }
  }
}

}  // namespace
}  // namespace sightline
