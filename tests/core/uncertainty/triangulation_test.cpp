// SPDX-License-Identifier: Apache-2.0
#include "core/triangulation/triangulation.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>

#include "core/physics/angle.h"
#include "core/random/counter_random.h"
#include "core/rig/measurement.h"
#include "core/rig/scan_geometry.h"

namespace sightline {
namespace {

using Derivatives = Eigen::Matrix<double, 3, kTriangulationVariables>;

struct Sample {
  TriangulationSetup setup;
  Eigen::Vector3d point_m;  // on the sheet, in view
  Eigen::Vector2d image_px;
  double camera_distance_m = 0;
};

double Uniform(CounterRandom& random, double min, double max) {
  return min + (max - min) * random.Uniform();
}

Eigen::Vector3d UnitVector(CounterRandom& random) {
  return Eigen::Vector3d(random.Normal(), random.Normal(), random.Normal()).normalized();
}

// A measurement of Table 2.1 and a point of the sheet in view, within a quarter of the camera
// distance from the origin. In the part's frame, so that no axis of the world is special.
Sample RandomSample(uint64_t index) {
  CounterRandom random(11, index);
  const Rig rig;
  Measurement m;
  m.camera_distance_m = Uniform(random, 0.1, 0.8);
  m.triangulation_angle_rad =
      Uniform(random, 10 * kRadPerDeg, 80 * kRadPerDeg) * (random.Bits() % 2 == 0 ? 1 : -1);
  m.camera_azimuth_rad = Uniform(random, 0, 360 * kRadPerDeg);
  m.camera_polar_rad = Uniform(random, 0, 90 * kRadPerDeg);
  m.part_alpha_rad = Uniform(random, 0, 360 * kRadPerDeg);
  m.part_beta_rad = Uniform(random, 0, 360 * kRadPerDeg);
  m.part_gamma_rad = Uniform(random, 0, 360 * kRadPerDeg);
  m.offset_y_m = Uniform(random, -0.5, 0.5);
  m.offset_z_m = Uniform(random, -0.4, 0.4);
  const ScanGeometry g = MakeScanGeometry(rig, m);
  const Eigen::Vector3d centre(0.1, -0.2, 0.3);
  const double stage_m = Uniform(random, -0.5, 0.5);
  Sample sample;
  sample.camera_distance_m = m.camera_distance_m;
  sample.setup = MakeTriangulationSetup(rig.camera, WorldToPart(g, centre, g.camera, stage_m),
                                        WorldToPart(g, centre, g.laser, stage_m));
  const SensorPose& laser = sample.setup.laser;
  const Eigen::Vector3d origin = laser.origin_m + m.camera_distance_m * laser.z_axis;
  const double radius_m = 0.25 * m.camera_distance_m;
  for (int attempt = 0; attempt < 100; ++attempt) {
    const double x = Uniform(random, -radius_m, radius_m), z = Uniform(random, -radius_m, radius_m);
    sample.point_m = origin + x * laser.x_axis + z * laser.z_axis;
    sample.image_px = ProjectPoint(sample.setup, sample.point_m);
    if ((sample.image_px.array() > 0).all() && (sample.image_px.array() < 512).all()) break;
  }
  return sample;
}

// A camera 0.4 m above the origin looking down, a laser turned by `angle_rad` about the line.
TriangulationSetup SimpleSetup(double angle_rad) {
  Measurement m;
  m.camera_distance_m = 0.4;
  m.triangulation_angle_rad = angle_rad;
  const Rig rig;
  const ScanGeometry g = MakeScanGeometry(rig, m);
  return MakeTriangulationSetup(rig.camera, g.camera, g.laser);
}

TriangulationErrors Only(TriangulationVariable variable, double value) {
  TriangulationErrors errors = TriangulationErrors::Zero();
  errors[variable] = value;
  return errors;
}

// Symmetric with correlations between all variables, of the standard deviations of Table 3.2.
TriangulationCovariance FullCovariance(uint64_t index) {
  CounterRandom random(12, index);
  TriangulationCovariance mixing;
  for (double& value : mixing.reshaped()) value = random.Normal();
  TriangulationCovariance covariance = mixing * mixing.transpose();
  const TriangulationErrors scale = MakeTriangulationCovariance(kThesisStandardDeviations)
                                        .diagonal()
                                        .cwiseQuotient(covariance.diagonal())
                                        .cwiseSqrt();
  covariance = scale.asDiagonal() * covariance * scale.asDiagonal();
  return 0.5 * (covariance + covariance.transpose());
}

// Moments of the point's deviation.
struct Moments {
  Eigen::Vector3d mean;
  Eigen::Matrix3d covariance;
};
template <typename DrawErrors>
Moments MonteCarlo(const Sample& sample, int draws, const DrawErrors& draw_errors) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  Eigen::Matrix3d squares = Eigen::Matrix3d::Zero();
  for (int i = 0; i < draws; ++i) {
    const Eigen::Vector3d d =
        Triangulate(sample.setup, sample.image_px, draw_errors()) - sample.point_m;
    sum += d;
    squares += d * d.transpose();
  }
  const Eigen::Vector3d mean = sum / draws;
  return {mean, (squares - draws * mean * mean.transpose()) / (draws - 1)};
}

TriangulationErrors StandardNormal(CounterRandom& random) {
  TriangulationErrors xi;
  for (int i = 0; i < kTriangulationVariables; i += 2) {
    const auto pair = random.NormalPair();
    xi[i] = pair[0];
    xi[i + 1] = pair[1];
  }
  return xi;
}

// Relative standard error of a standard deviation from `draws` normal numbers.
double StandardError(int draws) { return 1 / std::sqrt(2.0 * draws); }

TEST(Triangulation, ReturnsThePointThatWasProjected) {
  for (int i = 0; i < 500; ++i) {
    const Sample s = RandomSample(i);
    EXPECT_NEAR((Triangulate(s.setup, s.image_px) - s.point_m).norm(), 0, 1e-12) << i;
  }
}

// Eq. 1.4 with its rows put right, solved as it is written.
TEST(Triangulation, SolvesTheLinearSystemOfTheThesis) {
  for (int i = 0; i < 100; ++i) {
    const Sample s = RandomSample(i);
    const SensorPose& c = s.setup.camera;
    const Eigen::Vector2d k = (s.image_px - s.setup.principal_point_px) / s.setup.focal_length_px;
    Eigen::Matrix3d m;
    m.row(0) = c.x_axis - c.z_axis * k.x();
    m.row(1) = c.y_axis - c.z_axis * k.y();
    m.row(2) = s.setup.laser.y_axis;
    Eigen::Vector3d q = m * c.origin_m;
    q[2] = s.setup.laser.y_axis.dot(s.setup.laser.origin_m);
    EXPECT_NEAR((m.lu().solve(q) - Triangulate(s.setup, s.image_px)).norm(), 0, 1e-12);
  }
}

// A setup that truly differs sees the point elsewhere; given the difference, Triangulate finds it.
TEST(Triangulation, FindsThePointSeenByASetupWithErrors) {
  for (int i = 0; i < 300; ++i) {
    const Sample s = RandomSample(i);
    CounterRandom random(13, i);
    TriangulationErrors e;
    for (double& value : e) value = Uniform(random, -1, 1);
    e.segment<2>(kImageX) *= 3;
    e.segment<3>(kCameraAlpha) *= 0.3;
    e.segment<3>(kCameraX) *= 0.1 * s.camera_distance_m;
    e.segment<2>(kSheetTiltX) *= 0.05;
    e[kSheetOffset] *= 0.01 * s.camera_distance_m;
    e[kFocalLengthError] *= 50;
    e.segment<2>(kPrincipalX) *= 20;

    TriangulationSetup truth = s.setup;
    Eigen::Matrix3d axes;
    axes << truth.camera.x_axis, truth.camera.y_axis, truth.camera.z_axis;
    truth.camera.origin_m += axes * e.segment<3>(kCameraX);
    const Eigen::Vector3d w = e.segment<3>(kCameraAlpha);
    axes *= Eigen::AngleAxisd(w.norm(), w.normalized()).toRotationMatrix();
    truth.camera.x_axis = axes.col(0);
    truth.camera.y_axis = axes.col(1);
    truth.camera.z_axis = axes.col(2);
    const Eigen::Vector3d tilt =
        e[kSheetTiltX] * truth.laser.x_axis + e[kSheetTiltZ] * truth.laser.z_axis;
    truth.laser.y_axis = Eigen::AngleAxisd(tilt.norm(), tilt.normalized()) * truth.laser.y_axis;
    truth.laser.origin_m += e[kSheetOffset] * truth.laser.y_axis;
    truth.focal_length_px += e[kFocalLengthError];
    truth.principal_point_px += e.segment<2>(kPrincipalX);

    // The line of the true sheet near the point, imaged by the true camera.
    const Eigen::Vector3d lit =
        s.point_m - truth.laser.y_axis * truth.laser.y_axis.dot(s.point_m - truth.laser.origin_m);
    if ((lit - truth.camera.origin_m).dot(truth.camera.z_axis) < 0.01) continue;
    const Eigen::Vector2d image = ProjectPoint(truth, lit) - e.segment<2>(kImageX);
    EXPECT_NEAR((Triangulate(s.setup, image, e) - lit).norm(), 0, 1e-11) << i;
  }
}

TEST(Triangulation, SheetTurnsAboutTheSource) {
  const Sample s = RandomSample(1);
  // Points of the sheet at the source do not move, however it is tilted about z.
  TriangulationSetup setup = s.setup;
  setup.laser.origin_m = s.point_m;
  for (const TriangulationVariable tilt : {kSheetTiltX, kSheetTiltZ}) {
    EXPECT_NEAR((Triangulate(setup, s.image_px, Only(tilt, 0.1)) - s.point_m).norm(), 0, 1e-12);
    EXPECT_GT((Triangulate(s.setup, s.image_px, Only(tilt, 0.1)) - s.point_m).norm(), 1e-3);
  }
}

// Two tilts theta cos(phi), theta sin(phi) are a normal on the cone of half angle theta.
TEST(Triangulation, TiltsReachTheConeOfTheThesis) {
  const Sample s = RandomSample(2);
  for (const double theta : {1e-6, 0.01, 0.3}) {
    for (const double phi : {0.0, 0.7, 2.0, 4.0}) {
      TriangulationErrors e = Only(kSheetTiltX, theta * std::cos(phi));
      e[kSheetTiltZ] = theta * std::sin(phi);
      const SensorPose& laser = s.setup.laser;
      const Eigen::Vector3d normal =
          std::cos(theta) * laser.y_axis +
          std::sin(theta) * (std::cos(phi) * laser.z_axis - std::sin(phi) * laser.x_axis);
      const Eigen::Vector3d ray = s.point_m - s.setup.camera.origin_m;
      const double along = normal.dot(laser.origin_m - s.setup.camera.origin_m) / normal.dot(ray);
      if (along <= 0) continue;
      EXPECT_NEAR(
          (Triangulate(s.setup, s.image_px, e) - s.setup.camera.origin_m - along * ray).norm(), 0,
          1e-11);
    }
  }
}

TEST(Triangulation, NoPointWhereTheRayMissesTheSheet) {
  const TriangulationSetup setup = SimpleSetup(30 * kRadPerDeg);
  const Eigen::Vector2d centre = setup.principal_point_px;
  EXPECT_TRUE(Triangulate(setup, centre).allFinite());
  // Rays in the image's column at 30 degrees to the axis run along the sheet; beyond, they meet it
  // behind the camera only.
  const double parallel_px = setup.focal_length_px * std::tan(30 * kRadPerDeg);
  int missed = 0;
  for (const double sign : {-1.0, 1.0}) {
    const Eigen::Vector2d beyond = centre + Eigen::Vector2d(0, sign * 1.1 * parallel_px);
    if (Triangulate(setup, beyond).allFinite()) continue;
    ++missed;
    EXPECT_TRUE(Triangulate(setup, beyond).array().isNaN().all());
    EXPECT_TRUE(PointDerivatives(setup, beyond).array().isNaN().all());
    const PointUncertainty u =
        PropagateUncertainty(setup, beyond, MakeTriangulationCovariance(kThesisStandardDeviations));
    EXPECT_FALSE(u.first_order_suffices());
    EXPECT_EQ(u.second_order_difference, std::numeric_limits<double>::infinity());
  }
  EXPECT_EQ(missed, 1);
}

TEST(PointDerivatives, AgreeWithCentralDifferences) {
  // Steps for which the third-order rest, about (h/scale)^2, and the rounding, about 1e-16 scale/h,
  // are both near 1e-10.
  TriangulationErrors step;
  step << 1e-3, 1e-3, 1e-5, 1e-5, 1e-5, 1e-6, 1e-6, 1e-6, 1e-6, 1e-6, 1e-6, 1e-2, 1e-3, 1e-3;
  for (int i = 0; i < 1000; ++i) {
    const Sample s = RandomSample(i);
    const Derivatives analytic = PointDerivatives(s.setup, s.image_px);
    for (int k = 0; k < kTriangulationVariables; ++k) {
      const auto variable = static_cast<TriangulationVariable>(k);
      const Eigen::Vector3d difference =
          (Triangulate(s.setup, s.image_px, Only(variable, step[k])) -
           Triangulate(s.setup, s.image_px, Only(variable, -step[k]))) /
          (2 * step[k]);
      // Relative to the derivative, or to what a rounding error of the point allows.
      const double scale = analytic.col(k).norm() + 1e-8 / step[k];
      EXPECT_LT((difference - analytic.col(k)).norm(), 1e-6 * scale)
          << kTriangulationVariableNames[k] << ", sample " << i;
    }
  }
}

// Turned and moved as a whole, the setup gives turned derivatives.
TEST(PointDerivatives, TurnWithTheFrame) {
  const Sample s = RandomSample(3);
  const Eigen::Matrix3d turn =
      Eigen::AngleAxisd(1.1, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  TriangulationSetup turned = s.setup;
  for (SensorPose* pose : {&turned.camera, &turned.laser}) {
    pose->origin_m = turn * pose->origin_m + Eigen::Vector3d(1, -2, 3);
    pose->x_axis = turn * pose->x_axis;
    pose->y_axis = turn * pose->y_axis;
    pose->z_axis = turn * pose->z_axis;
  }
  const Derivatives d = PointDerivatives(s.setup, s.image_px);
  EXPECT_LT((PointDerivatives(turned, s.image_px) - turn * d).norm(), 1e-9 * d.norm());
}

// Looking straight down on a sheet at the angle tau, a shift of one pixel across the line is
// z / (f tan(tau)) of height (thesis eq. 1.2), one along the line z / f of width.
TEST(PointDerivatives, FollowTheTextbookFormulaInTheCentre) {
  for (const double tau_deg : {10.0, 30.0, -45.0, 80.0}) {
    const TriangulationSetup setup = SimpleSetup(tau_deg * kRadPerDeg);
    const Derivatives d = PointDerivatives(setup, setup.principal_point_px);
    const double pixel_m = 0.4 / setup.focal_length_px;
    EXPECT_NEAR(std::abs(d(2, kImageY)), pixel_m / std::tan(std::abs(tau_deg) * kRadPerDeg), 1e-12);
    EXPECT_NEAR(d(2, kImageX), 0, 1e-15);
    EXPECT_NEAR(d.col(kImageX).norm(), pixel_m, 1e-12);
    // A focal length does not matter on the axis, nor does a rotation about it.
    EXPECT_NEAR(d.col(kFocalLengthError).norm(), 0, 1e-15);
    EXPECT_NEAR(d.col(kCameraGamma).norm(), 0, 1e-15);
    // The sheet moves past the fixed ray.
    EXPECT_NEAR(std::abs(d(2, kSheetOffset)), 1 / std::sin(std::abs(tau_deg) * kRadPerDeg), 1e-12);
  }
}

// Camera and sheet moved together move the point along.
TEST(PointDerivatives, TranslationOfBothMovesThePoint) {
  for (int i = 0; i < 100; ++i) {
    const Sample s = RandomSample(i);
    const Derivatives d = PointDerivatives(s.setup, s.image_px);
    CounterRandom random(14, i);
    const Eigen::Vector3d move = UnitVector(random);
    const SensorPose& c = s.setup.camera;
    const Eigen::Vector3d moved =
        d.col(kCameraX) * c.x_axis.dot(move) + d.col(kCameraY) * c.y_axis.dot(move) +
        d.col(kCameraZ) * c.z_axis.dot(move) + d.col(kSheetOffset) * s.setup.laser.y_axis.dot(move);
    EXPECT_NEAR((moved - move).norm(), 0, 1e-9);
  }
}

// A detection error is a principal point error of the other sign.
TEST(PointDerivatives, PrincipalPointIsTheOppositeOfDetection) {
  const Sample s = RandomSample(4);
  const Derivatives d = PointDerivatives(s.setup, s.image_px);
  EXPECT_NEAR((d.col(kImageX) + d.col(kPrincipalX)).norm(), 0, 1e-15);
  EXPECT_NEAR((d.col(kImageY) + d.col(kPrincipalY)).norm(), 0, 1e-15);
}

TEST(ImageDerivativesAlong, EqualPointDerivatives) {
  for (int i = 0; i < 500; ++i) {
    const Sample s = RandomSample(i);
    CounterRandom random(15, i);
    const Eigen::Vector3d direction = UnitVector(random);
    TriangulationSetup setup = s.setup;
    // Every other sheet does not contain the direction of the image rows.
    if (i % 2 == 1) {
      const Eigen::Matrix3d turn = Eigen::AngleAxisd(0.2, setup.laser.z_axis).toRotationMatrix();
      setup.laser.x_axis = turn * setup.laser.x_axis;
      setup.laser.y_axis = turn * setup.laser.y_axis;
    }
    const Eigen::Vector3d point = Triangulate(setup, s.image_px);
    if (!point.allFinite()) continue;
    const Eigen::Vector3d ray = point - setup.camera.origin_m;
    const Eigen::Vector2d closed =
        ImageDerivativesAlong(direction, setup.camera, setup.focal_length_px, setup.laser.y_axis,
                              ray, ray.dot(setup.camera.z_axis));
    const Derivatives d = PointDerivatives(setup, s.image_px);
    EXPECT_LT((closed - (direction.transpose() * d.leftCols<2>()).transpose()).norm(),
              1e-12 * d.leftCols<2>().norm())
        << i;
  }
}

TEST(PropagateUncertainty, FirstOrderIsTheSandwich) {
  for (int i = 0; i < 20; ++i) {
    const Sample s = RandomSample(i);
    const TriangulationCovariance covariance = FullCovariance(i);
    const Derivatives d = PointDerivatives(s.setup, s.image_px);
    const Eigen::Matrix3d expected = d * covariance * d.transpose();
    const PointUncertainty u = PropagateUncertainty(s.setup, s.image_px, covariance);
    EXPECT_LT((u.covariance_m2 - expected).norm(), 1e-12 * expected.norm());
    EXPECT_EQ(FirstOrderCovariance(s.setup, s.image_px, covariance), u.covariance_m2);
  }
}

// Moved without being turned, camera and sheet move the point linearly.
TEST(PropagateUncertainty, LinearErrorsHaveNoSecondOrder) {
  const Sample s = RandomSample(5);
  TriangulationStandardDeviations deviations;
  deviations.camera_position_m = 0.01;
  deviations.laser_offset_m = 0.01;
  const PointUncertainty u =
      PropagateUncertainty(s.setup, s.image_px, MakeTriangulationCovariance(deviations));
  EXPECT_NEAR(u.second_order_shift_m.norm(), 0, 1e-15);
  EXPECT_NEAR(u.second_order_difference, 0, 1e-9);
}

TEST(PropagateUncertainty, NoErrorsNoUncertainty) {
  const Sample s = RandomSample(6);
  const PointUncertainty u =
      PropagateUncertainty(s.setup, s.image_px, TriangulationCovariance::Zero());
  EXPECT_EQ(u.covariance_m2, Eigen::Matrix3d::Zero());
  EXPECT_EQ(u.second_order_covariance_m2, Eigen::Matrix3d::Zero());
  EXPECT_EQ(u.second_order_difference, 0);
  EXPECT_TRUE(u.first_order_suffices());
}

// Detection errors alone leave the point on the sheet: no variance along its normal, in either
// order, and no false alarm from the singular matrices.
TEST(PropagateUncertainty, DetectionAloneKeepsThePointOnTheSheet) {
  TriangulationStandardDeviations deviations;
  deviations.detection_x_px = deviations.detection_y_px = 0.2;
  for (int i = 0; i < 50; ++i) {
    const Sample s = RandomSample(i);
    const PointUncertainty u =
        PropagateUncertainty(s.setup, s.image_px, MakeTriangulationCovariance(deviations));
    const Eigen::Vector3d n = s.setup.laser.y_axis;
    EXPECT_LT(n.dot(u.covariance_m2 * n), 1e-14 * u.covariance_m2.trace());
    EXPECT_LT(std::abs(n.dot(u.second_order_covariance_m2 * n)), 1e-14 * u.covariance_m2.trace());
    EXPECT_LT(u.second_order_difference, 0.02);
  }
}

// One variable, one image column: z = b / (a + k e) in closed form. Its moments to the fourth power
// of sigma, with r = k sigma / a: mean z (1 + r^2), variance z^2 (r^2 + 8 r^4).
TEST(PropagateUncertainty, MatchesTheSeriesOfAReciprocal) {
  const TriangulationSetup setup = SimpleSetup(20 * kRadPerDeg);
  const double sigma_px = 8;
  TriangulationStandardDeviations deviations;
  deviations.detection_y_px = sigma_px;
  const PointUncertainty u = PropagateUncertainty(setup, setup.principal_point_px,
                                                  MakeTriangulationCovariance(deviations));
  const double r = sigma_px / (setup.focal_length_px * std::tan(20 * kRadPerDeg));
  const double z = 0.4;
  const Eigen::Vector3d axis = setup.camera.z_axis;
  EXPECT_NEAR(axis.dot(u.covariance_m2 * axis), z * z * r * r, 1e-12);
  EXPECT_NEAR(axis.dot(u.second_order_shift_m), z * r * r, 1e-12);
  EXPECT_NEAR(axis.dot(u.second_order_covariance_m2 * axis), z * z * (r * r + 8 * r * r * r * r),
              1e-12);
  EXPECT_NEAR(u.second_order_difference, std::sqrt(1 + 8 * r * r) - 1, 1e-5);
}

// Hessians and contracted third derivatives by central differences of Triangulate.
TEST(PropagateUncertainty, SecondOrderAgreesWithDifferencesOfTriangulate) {
  for (int i = 0; i < 20; ++i) {
    const Sample s = RandomSample(i);
    const TriangulationCovariance covariance = FullCovariance(100 + i);
    const TriangulationCovariance factor = covariance.llt().matrixL();
    const auto at = [&](const TriangulationErrors& xi) -> Eigen::Vector3d {
      return Triangulate(s.setup, s.image_px, factor * xi) - s.point_m;
    };
    const auto e = [](int k) -> TriangulationErrors { return TriangulationErrors::Unit(k); };
    // In units of sigma; the rest is of the power h^2 times two more derivatives, about 1e-4 here.
    const double h = 1;
    Eigen::Matrix3d expected = Eigen::Matrix3d::Zero();
    Eigen::Vector3d shift = Eigen::Vector3d::Zero();
    const auto second = [&](int k, int l) -> Eigen::Vector3d {
      if (k == l) return (at(h * e(k)) + at(-h * e(k))) / (h * h);
      return (at(h * (e(k) + e(l))) + at(-h * (e(k) + e(l))) - at(h * (e(k) - e(l))) -
              at(-h * (e(k) - e(l)))) /
             (4 * h * h);
    };
    // d/dl of the second derivative along k.
    const auto third = [&](int k, int l) -> Eigen::Vector3d {
      if (k == l) {
        return (at(2 * h * e(k)) - 2 * at(h * e(k)) + 2 * at(-h * e(k)) - at(-2 * h * e(k))) /
               (2 * h * h * h);
      }
      const auto curvature = [&](double x) -> Eigen::Vector3d {
        return at(x * e(l) + h * e(k)) - 2 * at(x * e(l)) + at(x * e(l) - h * e(k));
      };
      return (curvature(h) - curvature(-h)) / (2 * h * h * h);
    };
    const Derivatives a = PointDerivatives(s.setup, s.image_px) * factor;
    for (int k = 0; k < kTriangulationVariables; ++k) {
      shift += 0.5 * second(k, k);
      for (int l = 0; l < kTriangulationVariables; ++l) {
        const Eigen::Vector3d hessian = second(k, l);
        expected += 0.5 * hessian * hessian.transpose();
        const Eigen::Matrix3d product = 0.5 * a.col(l) * third(k, l).transpose();
        expected += product + product.transpose();
      }
    }
    const PointUncertainty u = PropagateUncertainty(s.setup, s.image_px, covariance);
    const Eigen::Matrix3d correction = u.second_order_covariance_m2 - u.covariance_m2;
    EXPECT_LT((correction - expected).norm(), 0.02 * expected.norm()) << i;
    EXPECT_LT((u.second_order_shift_m - shift).norm(), 0.02 * shift.norm()) << i;
  }
}

// Along the principal directions, standard deviations of Table 3.2 by Monte Carlo are within 5 % of
// the first order, unless that is flagged; and they are those of the second order.
TEST(PropagateUncertainty, AgreesWithMonteCarloUnlessFlagged) {
  constexpr int kDraws = 20000;
  const double noise = 4.5 * StandardError(kDraws);
  int unflagged = 0;
  for (int i = 0; i < 40; ++i) {
    const Sample s = RandomSample(1000 + i);
    // Half with all variables correlated.
    const TriangulationCovariance covariance =
        i % 2 == 0 ? MakeTriangulationCovariance(kThesisStandardDeviations) : FullCovariance(i);
    const TriangulationCovariance factor = covariance.llt().matrixL();
    CounterRandom random(16, i);
    const Moments found = MonteCarlo(
        s, kDraws, [&]() -> TriangulationErrors { return factor * StandardNormal(random); });
    const PointUncertainty u = PropagateUncertainty(s.setup, s.image_px, covariance);
    if (!u.first_order_suffices()) continue;
    ++unflagged;
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> principal(u.covariance_m2);
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector3d v = principal.eigenvectors().col(k);
      const double sigma = std::sqrt(v.dot(found.covariance * v));
      const double first = std::sqrt(principal.eigenvalues()[k]);
      const double second = std::sqrt(v.dot(u.second_order_covariance_m2 * v));
      EXPECT_LT(std::abs(sigma / first - 1), 0.05 + noise) << i;
      EXPECT_LT(std::abs(sigma / second - 1), noise + 0.005) << i;
      EXPECT_LT(std::abs(v.dot(found.mean - u.second_order_shift_m)),
                4.5 * sigma / std::sqrt(kDraws) + 0.01 * sigma)
          << i;
    }
  }
  EXPECT_EQ(unflagged, 40);
}

// Variance of 1/(1 + r xi) by integration over xi, with xi beyond +- 8 left out.
double ReciprocalStandardDeviation(double r) {
  double weight = 0, sum = 0, squares = 0;
  for (int i = -8000; i <= 8000; ++i) {
    const double xi = 1e-3 * i, w = std::exp(-0.5 * xi * xi), value = 1 / (1 + r * xi);
    weight += w;
    sum += w * value;
    squares += w * value * value;
  }
  return std::sqrt(squares / weight - std::pow(sum / weight, 2));
}

// The reciprocal again: nothing may pass that is off by more than 5 %, and little be held back.
TEST(PropagateUncertainty, FlagsAReciprocalBeforeItIsFivePercentOff) {
  const TriangulationSetup setup = SimpleSetup(10 * kRadPerDeg);
  const double scale_px = setup.focal_length_px * std::tan(10 * kRadPerDeg);
  const auto suffices = [&](double r) {
    TriangulationStandardDeviations deviations;
    deviations.detection_y_px = r * scale_px;
    return PropagateUncertainty(setup, setup.principal_point_px,
                                MakeTriangulationCovariance(deviations))
        .first_order_suffices();
  };
  double r = 0.01;
  while (r < 0.12 && suffices(r)) r += 1e-3;
  EXPECT_LT(ReciprocalStandardDeviation(r) / r, 1.05);
  EXPECT_GT(ReciprocalStandardDeviation(r) / r, 1.04);
  for (; r < 0.5; r += 0.01) EXPECT_FALSE(suffices(r)) << r;
}

// Linear, yet not to be relied on: the point may lie behind the camera.
TEST(PropagateUncertainty, FlagsPointsThatMayLieBehindTheCamera) {
  const TriangulationSetup setup = SimpleSetup(10 * kRadPerDeg);
  // Depth moves by offset / sin(10 degrees).
  const double limit_m = 0.4 / 3 * std::sin(10 * kRadPerDeg);
  for (const double factor : {0.99, 1.01}) {
    TriangulationStandardDeviations deviations;
    deviations.laser_offset_m = factor * limit_m;
    const PointUncertainty u = PropagateUncertainty(setup, setup.principal_point_px,
                                                    MakeTriangulationCovariance(deviations));
    EXPECT_EQ(u.first_order_suffices(), factor < 1) << u.second_order_difference;
  }
}

// A normal on the thesis's cone, angle N(0, sigma), direction uniform, spreads the point as two
// tilts of sigma / sqrt(2) do. (Its tails are longer: the fourth moment of theta cos(phi) is 4.5
// sigma^4 / 4 against 3 sigma^4 / 4.)
TEST(PropagateUncertainty, TwoTiltsStandForTheCone) {
  constexpr int kDraws = 100000;
  const double sigma = 0.01 * kRadPerDeg;
  TriangulationStandardDeviations deviations;
  deviations.laser_tilt_rad = sigma / std::numbers::sqrt2;
  // Var of the sample variance is (kurtosis - 1)/n, kurtosis 4.5 instead of 3.
  const double noise = 4.5 * std::sqrt(3.5 / 2) * StandardError(kDraws);
  for (int i = 0; i < 10; ++i) {
    const Sample s = RandomSample(2000 + i);
    CounterRandom random(17, i);
    const Moments found = MonteCarlo(s, kDraws, [&] {
      const double theta = sigma * random.Normal();
      const double phi = Uniform(random, -std::numbers::pi, std::numbers::pi);
      TriangulationErrors e = Only(kSheetTiltX, theta * std::cos(phi));
      e[kSheetTiltZ] = theta * std::sin(phi);
      return e;
    });
    const PointUncertainty u =
        PropagateUncertainty(s.setup, s.image_px, MakeTriangulationCovariance(deviations));
    // Tilts move the point along its ray only.
    const Eigen::Vector3d along = (s.point_m - s.setup.camera.origin_m).normalized();
    EXPECT_NEAR(std::sqrt(along.dot(found.covariance * along) / along.dot(u.covariance_m2 * along)),
                1, noise)
        << i;
  }
}

TEST(TriangulationCovariance, DiagonalOfTable32) {
  const TriangulationErrors sigma =
      MakeTriangulationCovariance(kThesisStandardDeviations).diagonal().cwiseSqrt();
  const double angle = 0.01 * kRadPerDeg;
  TriangulationErrors expected;
  expected << 0.2, 0.2, angle, angle, angle, 5e-4, 5e-4, 5e-4, angle / std::sqrt(2),
      angle / std::sqrt(2), 5e-4, 2, 0.5, 0.5;
  EXPECT_LT((sigma - expected).cwiseQuotient(expected).norm(), 1e-14);
}

TEST(TriangulationCovariance, ValidOnesPass) {
  EXPECT_TRUE(CheckTriangulationCovariance(TriangulationCovariance::Zero(), "c").ok());
  EXPECT_TRUE(
      CheckTriangulationCovariance(MakeTriangulationCovariance(kThesisStandardDeviations), "c")
          .ok());
  for (int i = 0; i < 50; ++i) {
    EXPECT_TRUE(CheckTriangulationCovariance(FullCovariance(i), "c").ok());
    // A covariance of rank 1: everything hangs on one cause.
    const TriangulationErrors cause = FullCovariance(i).col(0);
    EXPECT_TRUE(CheckTriangulationCovariance(cause * cause.transpose(), "c").ok());
  }
}

// Messages say where, what and what is allowed.
TEST(TriangulationCovariance, FaultsAreNamed) {
  const TriangulationCovariance good = MakeTriangulationCovariance(kThesisStandardDeviations);
  const auto message = [](const TriangulationCovariance& c) {
    return std::string(CheckTriangulationCovariance(c, "rig.json: covariance").message());
  };
  TriangulationCovariance bad = good;
  bad(kFocalLengthError, kFocalLengthError) = -4;
  EXPECT_EQ(message(bad),
            "rig.json: covariance: variance of focal length is -4, must be 0 or more");
  bad = good;
  bad(kSheetOffset, kSheetOffset) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(message(bad), "rig.json: covariance: variance of sheet offset is NaN, must be finite");
  bad = good;
  bad(kImageX, kFocalLengthError) = std::numeric_limits<double>::infinity();
  EXPECT_EQ(
      message(bad),
      "rig.json: covariance: covariance of detection x with focal length is Infinity, must be "
      "finite");
  bad = good;
  bad(kPrincipalX, kFocalLengthError) = 0.1;
  EXPECT_EQ(message(bad),
            "rig.json: covariance: covariance of principal point x with focal length is 0.1, must "
            "be equal to the covariance of focal length with principal point x, which is 0: a "
            "covariance is symmetric");
  bad = good;
  bad(kPrincipalX, kFocalLengthError) = bad(kFocalLengthError, kPrincipalX) = 1.5;
  EXPECT_EQ(message(bad),
            "rig.json: covariance: covariance of principal point x with focal length is 1.5, must "
            "be within +- 1, the product of the two standard deviations");
  bad(kPrincipalX, kPrincipalX) = 0;
  EXPECT_NE(message(bad).find("within +- 0"), std::string::npos) << message(bad);
  // Pairs may fit where three do not.
  bad = good;
  const auto correlate = [&](int i, int j, double correlation) {
    bad(i, j) = bad(j, i) = correlation * std::sqrt(bad(i, i) * bad(j, j));
  };
  correlate(kFocalLengthError, kPrincipalX, 0.9);
  correlate(kFocalLengthError, kPrincipalY, 0.9);
  correlate(kPrincipalX, kPrincipalY, -0.9);
  EXPECT_EQ(message(bad).find("rig.json: covariance: correlations of focal length, principal point "
                              "x, principal point y do not fit together: the smallest eigenvalue "
                              "of the correlation matrix is -0.8"),
            0U)
      << message(bad);
}

// Propagation must accept every covariance that the check accepts: singular matrices with rounded
// numbers.
TEST(TriangulationCovariance, SingularOnesPropagate) {
  for (int i = 0; i < 20; ++i) {
    const Sample s = RandomSample(i);
    const TriangulationErrors cause =
        FullCovariance(i).llt().matrixL() * TriangulationErrors::Ones();
    TriangulationCovariance covariance = cause * cause.transpose();
    const PointUncertainty u = PropagateUncertainty(s.setup, s.image_px, covariance);
    const Eigen::Vector3d moved = PointDerivatives(s.setup, s.image_px) * cause;
    EXPECT_LT((u.covariance_m2 - moved * moved.transpose()).norm(), 1e-9 * moved.squaredNorm());
    EXPECT_TRUE(std::isfinite(u.second_order_difference));
  }
}

}  // namespace
}  // namespace sightline
