// SPDX-License-Identifier: Apache-2.0
#include "core/conformance/conformance.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "core/conformance/decision.h"
#include "core/conformance/feature.h"
#include "core/random/counter_random.h"
#include "core/rig/measurement.h"
#include "core/rig/rig.h"
#include "core/rig/scan_geometry.h"
#include "core/surface_inference/surface_estimate.h"
#include "core/surface_inference/surface_inference.h"
#include "core/tolerance/tolerance.h"
#include "core/triangulation/triangulation.h"

namespace sightline {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;
using testing::AllOf;
using testing::HasSubstr;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

double Below(double z) { return 0.5 * std::erfc(-z / std::numbers::sqrt2); }

// Decision.

TEST(Acceptance, GuardBandsAtEveryLimitThatCanBeViolated) {
  const Interval two = AcceptanceInterval({ZoneKind::kTwoSided, 0.2e-3}, 0.02e-3, 2);
  EXPECT_NEAR(two.lower_m, -0.06e-3, 1e-15);
  EXPECT_NEAR(two.width_m(), 0.2e-3 - 4 * 0.02e-3, 1e-15);
  const Interval one = AcceptanceInterval({ZoneKind::kOneSided, 0.2e-3}, 0.02e-3, 2);
  EXPECT_EQ(one.lower_m, 0);
  EXPECT_NEAR(one.upper_m, 0.16e-3, 1e-15);
  // At u = s_t / 4 and g = 2 nothing is left (errata of thesis section 3.3).
  EXPECT_NEAR(AcceptanceInterval({ZoneKind::kTwoSided, 0.2e-3}, 0.05e-3, 2).width_m(), 0, 1e-15);
}

// Deaver, Guardbanding with confidence, NCSL Workshop and Symposium 1994: normal production of
// standard deviation 1, limits +-SL, measurement of standard deviation 1/TUR.
TEST(DecisionProbabilities, AgreeWithDeaversPublishedValues) {
  const auto plain = DecisionProbabilities({ZoneKind::kTwoSided, 4}, 0.25, 0, {0, 1});
  ASSERT_TRUE(plain.ok());
  EXPECT_NEAR(plain->wrong_acceptance, 0.008, 0.0005);
  EXPECT_NEAR(plain->wrong_rejection, 0.015, 0.0005);
  const auto wide = DecisionProbabilities({ZoneKind::kTwoSided, 5}, 0.25, 0, {0, 1});
  ASSERT_TRUE(wide.ok());
  EXPECT_NEAR(wide->wrong_acceptance, 0.0025, 0.0001);
  // Acceptance limits at 0.91 SL: guard band 0.18 = 0.36 u.
  const auto guarded = DecisionProbabilities({ZoneKind::kTwoSided, 4}, 0.5, 0.36, {0, 1});
  ASSERT_TRUE(guarded.ok());
  EXPECT_NEAR(guarded->wrong_acceptance, 0.008, 0.0005);
  EXPECT_NEAR(guarded->wrong_rejection, 0.066, 0.001);
}

// Ball bearings of JCGM 106, 9.5.4: radial error motion below 2 um, production a gamma distribution
// of mean 1 um and standard deviation 0.5 um (shape 4, rate 4/um), measured with u = 0.25 um. The
// share that does not conform is exp(-8) (1 + 8 + 32 + 256/3) = 4.24 %.
TEST(DecisionProbabilities, GammaProductionOfJcgm106) {
  const ToleranceZone zone{ZoneKind::kOneSided, 2e-6};
  const auto p = DecisionProbabilities(zone, 0.25e-6, 0, {1e-6, 0.5e-6});
  ASSERT_TRUE(p.ok());
  EXPECT_NEAR(1 - p->conforming, std::exp(-8.0) * (1 + 8 + 32 + 256.0 / 3), 1e-9);
  // Integral over the measured value instead of the true one, by sums over a fine grid.
  const double step = 0.002;
  double accepted_bad = 0, rejected_good = 0;
  for (double v = step / 2; v < 12; v += step) {
    const double density = std::pow(4.0, 4) / 6 * v * v * v * std::exp(-4 * v);
    double accept = 0;
    for (double y = v - 8 * 0.25; y < 2; y += step) {  // cells that end at 2
      const double z = (y - v) / 0.25;
      accept += step * std::exp(-0.5 * z * z) / (0.25 * std::sqrt(2 * std::numbers::pi));
    }
    (v > 2 ? accepted_bad : rejected_good) += step * density * (v > 2 ? accept : 1 - accept);
  }
  EXPECT_NEAR(p->wrong_acceptance, accepted_bad, 1e-5);
  EXPECT_NEAR(p->wrong_rejection, rejected_good, 1e-4);
}

TEST(DecisionProbabilities, AgreeWithDrawsOfPartsAndMeasurements) {
  const ToleranceZone zone{ZoneKind::kTwoSided, 1e-4};
  const double u = 0.8e-5, guard = 1.65;
  const Production production{1e-5, 3e-5};
  const auto p = DecisionProbabilities(zone, u, guard, production, 2e-6);
  ASSERT_TRUE(p.ok());
  const Interval accepted = AcceptanceInterval(zone, u, guard);
  constexpr int kDraws = 400000;
  int wrong_acceptance = 0, wrong_rejection = 0;
  CounterRandom random(7, 0);
  for (int i = 0; i < kDraws; ++i) {
    const auto [a, b] = random.NormalPair();
    const double v = production.mean_m + a * production.standard_deviation_m;
    const double y = v + 2e-6 + b * u;
    const bool conforms = std::abs(v) <= 0.5e-4;
    const bool taken = y >= accepted.lower_m && y <= accepted.upper_m;
    wrong_acceptance += taken && !conforms;
    wrong_rejection += !taken && conforms;
  }
  const auto within = [&](double probability, int count) {
    const double s = std::sqrt(probability * (1 - probability) / kDraws);
    EXPECT_NEAR(static_cast<double>(count) / kDraws, probability, 4 * s);
  };
  within(p->wrong_acceptance, wrong_acceptance);
  within(p->wrong_rejection, wrong_rejection);
}

TEST(DecisionProbabilities, ExactMeasurementDecidesRightly) {
  for (const double u : {0.0, 1e-12}) {
    for (const ZoneKind kind : {ZoneKind::kTwoSided, ZoneKind::kOneSided}) {
      const ToleranceZone zone{kind, 1e-4};
      const auto p = DecisionProbabilities(zone, u, 2, Production::CapableOf(zone));
      ASSERT_TRUE(p.ok());
      EXPECT_NEAR(p->wrong_acceptance, 0, 1e-8);
      EXPECT_NEAR(p->wrong_rejection, 0, 1e-7);
      EXPECT_NEAR(p->accepted, p->conforming, 1e-7);
    }
  }
  const auto capable = DecisionProbabilities({ZoneKind::kTwoSided, 6}, 0, 0, {0, 1});
  ASSERT_TRUE(capable.ok());
  EXPECT_NEAR(capable->conforming, std::erf(3 / std::numbers::sqrt2), 1e-10);
}

TEST(DecisionProbabilities, GuardBandsTradeWrongAcceptanceForWrongRejection) {
  const ToleranceZone zone{ZoneKind::kTwoSided, 1e-4};
  double acceptance = 1, rejection = 0;
  for (const double guard : {0.0, 0.5, 1.0, 2.0, 4.0}) {
    const auto p = DecisionProbabilities(zone, 1e-5, guard, {0, 3e-5});
    ASSERT_TRUE(p.ok());
    EXPECT_LT(p->wrong_acceptance, acceptance);
    EXPECT_GT(p->wrong_rejection, rejection);
    acceptance = p->wrong_acceptance;
    rejection = p->wrong_rejection;
  }
  // No acceptance zone: nothing is accepted, all that conform are rejected.
  const auto empty = DecisionProbabilities(zone, 3e-5, 2, {0, 3e-5});
  ASSERT_TRUE(empty.ok());
  EXPECT_EQ(empty->wrong_acceptance, 0);
  EXPECT_NEAR(empty->wrong_rejection, empty->conforming, 1e-12);
}

TEST(DecisionProbabilities, RefusesWhatIsOutsideItsRange) {
  const ToleranceZone one{ZoneKind::kOneSided, 1e-4};
  EXPECT_THAT(DecisionProbabilities(one, 1e-5, 2, {1e-5, 2e-5}).status().message(),
              HasSubstr("standard_deviation_m of a one-sided zone"));
  EXPECT_FALSE(DecisionProbabilities(one, -1e-5, 2, {2e-5, 2e-5}).ok());
  EXPECT_FALSE(DecisionProbabilities({ZoneKind::kTwoSided, 0}, 1e-5, 2, {0, 1}).ok());
  EXPECT_FALSE(DecisionProbabilities({ZoneKind::kTwoSided, 1}, kInfinity, 2, {0, 1}).ok());
}

TEST(ConformanceProbability, WithoutPriorKnowledge) {
  const ToleranceZone two{ZoneKind::kTwoSided, 2};
  EXPECT_NEAR(*ConformanceProbability(two, 0.5, 0.25), Below(2) - Below(-6), 1e-12);
  // At the edge of the acceptance zone with g = 1.65: 95 %.
  EXPECT_NEAR(*ConformanceProbability(two, 1 - 1.65 * 0.1, 0.1), 0.9505, 1e-4);
  // One-sided: what is below zero is ruled out, also where the estimate lies there.
  const ToleranceZone one{ZoneKind::kOneSided, 1};
  EXPECT_NEAR(*ConformanceProbability(one, 0.2, 0.5), (Below(1.6) - Below(-0.4)) / Below(0.4),
              1e-12);
  EXPECT_GT(*ConformanceProbability(one, -2, 0.5), 0.99);
}

TEST(ConformanceProbability, WithProduction) {
  // Normal production and measurement: posterior N(w y, (1/s^2 + 1/u^2)^-1).
  const double s = 3e-5, u = 2e-5, y = 4e-5;
  const double posterior = 1 / std::sqrt(1 / (s * s) + 1 / (u * u));
  const double mean = y * posterior * posterior / (u * u);
  const ToleranceZone two{ZoneKind::kTwoSided, 1e-4};
  EXPECT_NEAR(*ConformanceProbability(two, y, u, Production{0, s}),
              Below((5e-5 - mean) / posterior) - Below((-5e-5 - mean) / posterior), 1e-9);
  // Specific and global probabilities belong together: the mean over all measured values of the
  // probability of conformance is the share that conforms.
  const ToleranceZone one{ZoneKind::kOneSided, 2};
  const Production gamma{1, 0.5};
  double mean_probability = 0;
  const double step = 0.02;
  for (double measured = -2; measured < 8; measured += step) {
    double density = 0;
    for (double v = 0.005; v < 10; v += 0.01) {
      const double z = (measured - v) / 0.25;
      density += 0.01 * std::pow(4.0, 4) / 6 * v * v * v * std::exp(-4 * v) *
                 std::exp(-0.5 * z * z) / (0.25 * std::sqrt(2 * std::numbers::pi));
    }
    if (density < 1e-12) continue;
    mean_probability += step * density * *ConformanceProbability(one, measured, 0.25, gamma);
  }
  EXPECT_NEAR(mean_probability, DecisionProbabilities(one, 0.25, 0, gamma)->conforming, 1e-5);
}

// Features.

SurfaceUncertainty Independent(double noise_m, double sampling_m) {
  SurfaceUncertainty u{};
  u.noise_m = noise_m;
  u.sampling_m = sampling_m;
  u.total_m = std::hypot(noise_m, sampling_m);
  return u;
}

Feature Plane(int per_side, double size_m, double noise_m) {
  Feature f;
  f.geometry = FeatureGeometry::kPlane;
  for (int i = 0; i < per_side; ++i) {
    for (int j = 0; j < per_side; ++j) {
      FeatureTarget t;
      t.position_m = size_m * Vector3d(i / (per_side - 1.0) - 0.5, j / (per_side - 1.0) - 0.5, 0);
      t.uncertainty = Independent(noise_m, 0);
      f.targets.push_back(t);
    }
  }
  return f;
}

Feature Cylinder(double radius_m, double arc_rad, int around, int along, bool bore) {
  Feature f;
  f.geometry = FeatureGeometry::kCylinder;
  f.axis = Vector3d(1, 2, 2).normalized();
  f.axis_point_m = Vector3d(0.1, -0.2, 0.3);
  const Vector3d x = f.axis.unitOrthogonal(), y = f.axis.cross(x);
  for (int i = 0; i < around; ++i) {
    for (int j = 0; j < along; ++j) {
      const double angle = arc_rad * (i / static_cast<double>(around) - 0.5);
      const Vector3d r = std::cos(angle) * x + std::sin(angle) * y;
      FeatureTarget t;
      t.position_m = f.axis_point_m + radius_m * r + 0.03 * (j / (along - 1.0) - 0.5) * f.axis;
      t.normal = bore ? Vector3d(-r) : r;
      t.uncertainty = Independent(1e-5, 0);
      f.targets.push_back(t);
    }
  }
  return f;
}

CalibrationCovariance SomeCovariance() {
  CalibrationCovariance c = CalibrationCovariance::Zero();
  const double s[kCalibrationVariables] = {3e-5, 3e-5, 3e-5, 2e-5, 2e-5, 2e-5,
                                           3e-5, 3e-5, 2e-5, 0.2,  0.1,  0.1};
  for (int i = 0; i < kCalibrationVariables; ++i) c(i, i) = s[i] * s[i];
  c(0, 4) = c(4, 0) = 0.6 * s[0] * s[4];
  return c;
}

// Two scans that look at the feature from either side, with weights that vary.
void AddScans(Feature& f, bool common) {
  const auto n = static_cast<Eigen::Index>(f.targets.size());
  Vector3d centre = Vector3d::Zero(), normal = Vector3d::Zero();
  for (const FeatureTarget& t : f.targets) {
    centre += t.position_m / static_cast<double>(n);
    normal += t.normal;
  }
  const Vector3d z = normal.normalized(), x = z.unitOrthogonal(), y = z.cross(x);
  for (int s = 0; s < 2; ++s) {
    const auto look = [&](double tilt_rad) {
      const Vector3d direction = std::cos(tilt_rad) * z + std::sin(tilt_rad) * (s == 0 ? x : y);
      SensorPose pose;
      pose.z_axis = -direction;
      pose.x_axis = (s == 0 ? y : x).normalized();
      pose.y_axis = pose.z_axis.cross(pose.x_axis);
      pose.origin_m = centre + 0.3 * direction;
      return pose;
    };
    TriangulationSetup setup;
    setup.camera = look(0.3);
    setup.laser = look(-0.2);
    setup.focal_length_px = 2400;
    ScanSensitivity scan;
    scan.derivatives.resize(n, kCalibrationVariables);
    scan.weights.resize(n);
    for (Eigen::Index i = 0; i < n; ++i) {
      const FeatureTarget& t = f.targets[static_cast<size_t>(i)];
      TriangulationSetup lit = setup;  // the stage brings the target into the sheet
      const Vector3d to_sheet = t.position_m - centre;
      lit.camera.origin_m += to_sheet.dot(s == 0 ? x : y) * (s == 0 ? x : y);
      lit.laser.origin_m += to_sheet;
      scan.derivatives.row(i) = CalibrationDerivatives(lit, t.position_m, t.normal);
      scan.weights[i] = 0.5 + (s == 0 ? 0.3 : -0.3) * std::sin(0.7 * static_cast<double>(i));
    }
    if (!common) scan.covariance = SomeCovariance();
    if (common) scan.covariance = CalibrationCovariance::Zero();
    f.scans.push_back(scan);
  }
  if (common) f.common_covariance = SomeCovariance();
}

// Draws of the errors of all targets by their definition, not by way of F.
VectorXd DrawErrors(const Feature& f, uint64_t draw) {
  CounterRandom random(11, draw);
  const auto one = [&](const CalibrationCovariance& c) {
    Eigen::Matrix<double, kCalibrationVariables, 1> e;
    for (double& x : e) x = random.Normal();
    if (c.isZero(0)) return Eigen::Matrix<double, kCalibrationVariables, 1>(0 * e);
    return Eigen::Matrix<double, kCalibrationVariables, 1>(c.llt().matrixL() * e);
  };
  const auto shared = one(f.common_covariance);
  VectorXd errors(static_cast<Eigen::Index>(f.targets.size()));
  for (size_t i = 0; i < f.targets.size(); ++i) {
    errors[static_cast<Eigen::Index>(i)] = f.targets[i].uncertainty.total_m * random.Normal();
  }
  for (const ScanSensitivity& scan : f.scans) {
    errors += scan.weights.cwiseProduct(scan.derivatives * (one(scan.covariance) + shared));
  }
  return errors;
}

TEST(FeatureFit, PlaneRecoversOffsetAndTilt) {
  const Feature f = Plane(5, 0.04, 1e-6);
  const auto fit = FitFeature(f, Measurand::kOrientation);
  ASSERT_TRUE(fit.ok()) << fit.status();
  VectorXd h(25);
  for (int i = 0; i < 25; ++i) {
    const Vector3d& p = f.targets[static_cast<size_t>(i)].position_m;
    h[i] = 3e-5 + 1e-3 * p.x() - 2e-3 * p.y();
  }
  EXPECT_NEAR(FormDeviation(*fit, h), 0, 1e-15);
  const VectorXd parameters = fit->estimator * h;
  EXPECT_NEAR(parameters[0], 3e-5, 1e-15);
  // The fall over the feature, between opposite corners.
  EXPECT_NEAR((fit->functionals * parameters).cwiseAbs().maxCoeff(), 3e-3 * 0.04, 1e-12);
}

TEST(FeatureFit, CylinderRecoversRadiusAndAxis) {
  for (const bool bore : {false, true}) {
    const Feature f = Cylinder(0.02, 2.0, 8, 4, bore);
    // A cylinder of 5 um more radius whose axis is displaced and tilted, measured exactly.
    const Vector3d shift = 4e-6 * f.axis.unitOrthogonal();
    const Vector3d axis = (f.axis + 1e-4 * f.axis.cross(f.axis.unitOrthogonal())).normalized();
    Vector3d centre = Vector3d::Zero();
    for (const FeatureTarget& t : f.targets) centre += t.position_m / 32.0;
    const Vector3d on_axis = f.axis_point_m + f.axis * f.axis.dot(centre - f.axis_point_m) + shift;
    VectorXd h(32);
    for (int i = 0; i < 32; ++i) {
      const FeatureTarget& t = f.targets[static_cast<size_t>(i)];
      const Vector3d d = t.position_m - on_axis;
      const double distance_m = (d - axis * axis.dot(d)).norm();
      h[i] = (bore ? -1 : 1) * (0.02 + 5e-6 - distance_m);
    }
    const auto size = FitFeature(f, Measurand::kSize);
    ASSERT_TRUE(size.ok()) << size.status();
    EXPECT_NEAR((size->functionals * size->estimator * h)(0), 2 * 5e-6, 1e-9);
    EXPECT_LT(FormDeviation(*size, h), 1e-9);
    const auto position = FitFeature(f, Measurand::kPosition);
    ASSERT_TRUE(position.ok());
    const double tilt_m = 1e-4 * 0.015;
    EXPECT_NEAR((position->functionals * position->estimator * h).cwiseAbs().maxCoeff(),
                std::hypot(4e-6, tilt_m), 1e-8);
  }
}

TEST(FeatureFit, ThicknessOfAWall) {
  Feature f;
  f.geometry = FeatureGeometry::kTwoPlanes;
  for (int face = 0; face < 2; ++face) {
    Feature plane = Plane(3, 0.02, 1e-5);
    for (FeatureTarget& t : plane.targets) {
      t.face = face;
      t.position_m.z() = face == 0 ? 0.005 : -0.005;
      t.normal = face == 0 ? Vector3d::UnitZ() : Vector3d(-Vector3d::UnitZ());
      f.targets.push_back(t);
    }
  }
  const auto fit = FitFeature(f, Measurand::kSize);
  ASSERT_TRUE(fit.ok()) << fit.status();
  VectorXd h(18);
  h << VectorXd::Constant(9, 2e-6), VectorXd::Constant(9, 3e-6);
  EXPECT_NEAR(std::abs((fit->functionals * fit->estimator * h)(0)), 5e-6, 1e-15);
  // Two means of nine targets each.
  EXPECT_NEAR(PredictUncertainty(f, Measurand::kSize)->u.total_m, 1e-5 * std::sqrt(2.0 / 9), 1e-12);
}

TEST(FeatureFit, WhatTheTargetsDoNotDetermine) {
  Feature line = Plane(5, 0.04, 1e-6);
  for (FeatureTarget& t : line.targets) t.position_m.y() = 0;
  EXPECT_EQ(FitFeature(line, Measurand::kForm).status().code(),
            absl::StatusCode::kFailedPrecondition);
  Feature few = Plane(5, 0.04, 1e-6);
  for (size_t i = 2; i < few.targets.size(); ++i) few.targets[i].measured = false;
  EXPECT_FALSE(FitFeature(few, Measurand::kForm).ok());
  EXPECT_FALSE(FitFeature(Plane(5, 0.04, 1e-6), Measurand::kSize).ok());
}

TEST(PredictUncertainty, OffsetOfAPlaneAveragesIndependentErrors) {
  Feature f = Plane(5, 0.04, 1e-5);
  for (FeatureTarget& t : f.targets) t.uncertainty = Independent(0.8e-5, 0.6e-5);
  const auto fit = FitFeature(f, Measurand::kPosition);
  ASSERT_TRUE(fit.ok());
  // At the corner of a square of targets: 1/n + x^2/S_xx + y^2/S_yy.
  double s = 0;
  for (const FeatureTarget& t : f.targets) s += t.position_m.x() * t.position_m.x();
  const auto u = PredictUncertainty(f, Measurand::kPosition);
  ASSERT_TRUE(u.ok());
  EXPECT_NEAR(u->u.total_m, 1e-5 * std::sqrt(1.0 / 25 + 2 * 0.02 * 0.02 / s), 1e-12);
  EXPECT_NEAR(u->u.noise_m / u->u.sampling_m, 0.8 / 0.6, 1e-9);
  EXPECT_EQ(u->u.calibration_m, 0);
}

TEST(PredictUncertainty, CommonOffsetDoesNotAverageOutAndLeavesFormAlone) {
  Feature f = Plane(5, 0.04, 0);
  ScanSensitivity scan;
  scan.derivatives = decltype(scan.derivatives)::Zero(25, kCalibrationVariables);
  scan.derivatives.col(kSheetOffset - 2).setConstant(1.5);
  scan.weights = VectorXd::Ones(25);
  scan.covariance = CalibrationCovariance::Zero();
  scan.covariance(kSheetOffset - 2, kSheetOffset - 2) = 1e-10;
  f.scans = {scan};
  EXPECT_NEAR(PredictUncertainty(f, Measurand::kPosition)->u.calibration_m, 1.5e-5, 1e-14);
  EXPECT_NEAR(PredictUncertainty(f, Measurand::kDeviation)->u.total_m, 1.5e-5, 1e-14);
  EXPECT_NEAR(PredictUncertainty(f, Measurand::kForm)->u.total_m, 0, 1e-14);
  EXPECT_NEAR(PredictUncertainty(f, Measurand::kOrientation)->u.total_m, 0, 1e-14);
  // Two scans with equal weights: errors of their own average, shared ones do not.
  f.scans = {scan, scan};
  for (ScanSensitivity& s : f.scans) s.weights *= 0.5;
  EXPECT_NEAR(PredictUncertainty(f, Measurand::kPosition)->u.total_m, 1.5e-5 / std::sqrt(2.0),
              1e-14);
  for (ScanSensitivity& s : f.scans) s.covariance.setZero();
  f.common_covariance = scan.covariance;
  EXPECT_NEAR(PredictUncertainty(f, Measurand::kPosition)->u.total_m, 1.5e-5, 1e-14);
}

// Linear propagation against draws of all errors by their definition.
TEST(PredictUncertainty, AgreesWithDraws) {
  constexpr int kDraws = 4000;
  // A standard deviation from so many draws has the relative standard error 1 / sqrt(2 draws).
  const double tolerance = 4 / std::sqrt(2.0 * kDraws);
  for (const bool common : {false, true}) {
    std::vector<Feature> features = {Plane(5, 0.04, 1e-5), Cylinder(0.02, 2.0, 8, 4, false)};
    for (Feature& f : features) {
      AddScans(f, common);
      for (const Measurand m : {Measurand::kPosition, Measurand::kOrientation, Measurand::kSize}) {
        if (m == Measurand::kSize && f.geometry == FeatureGeometry::kPlane) continue;
        const auto fit = FitFeature(f, m);
        const auto u = PredictUncertainty(f, m);
        ASSERT_TRUE(fit.ok() && u.ok()) << fit.status() << u.status();
        double squares = 0;
        for (int d = 0; d < kDraws; ++d) {
          const VectorXd e = DrawErrors(f, static_cast<uint64_t>(d));
          const double value = fit->functionals.row(u->worst).dot(fit->estimator * e);
          squares += value * value;
        }
        const double spread = std::sqrt(squares / kDraws);
        EXPECT_NEAR(u->u.total_m / spread, 1, tolerance);
        EXPECT_GT(u->u.calibration_m, 0.3 * u->u.noise_m);
        EXPECT_NEAR(std::hypot(u->u.noise_m, u->u.sampling_m, u->u.calibration_m), u->u.total_m,
                    1e-12);
      }
    }
  }
}

// Range of residuals: bias on a perfect feature, and that u covers it on one of real form.
TEST(PredictUncertainty, FormBiasAndSpread) {
  for (const bool calibration : {false, true}) {
    Feature f = Plane(5, 0.04, 1e-5);
    if (calibration) AddScans(f, false);
    const auto fit = FitFeature(f, Measurand::kForm);
    const auto u = PredictUncertainty(f, Measurand::kForm);
    ASSERT_TRUE(fit.ok() && u.ok());
    constexpr int kDraws = 4000;
    VectorXd form = VectorXd::Zero(25);
    form[12] = 2e-4;  // a bump and a dent, far above the errors
    form[2] = -2e-4;
    const double true_form_m = FormDeviation(*fit, form);
    double perfect = 0, perfect_squares = 0, bumpy = 0, squares = 0;
    for (int d = 0; d < kDraws; ++d) {
      const VectorXd e = DrawErrors(f, static_cast<uint64_t>(d));
      const double range = FormDeviation(*fit, e);
      perfect += range / kDraws;
      perfect_squares += range * range / kDraws;
      const double error = FormDeviation(*fit, form + e) - true_form_m;
      bumpy += error / kDraws;
      squares += error * error / kDraws;
    }
    const double perfect_spread = std::sqrt(perfect_squares - perfect * perfect);
    EXPECT_NEAR(u->bias_m, perfect, 4 * perfect_spread * std::sqrt(1.0 / kDraws + 1.0 / 2000));
    EXPECT_GT(u->bias_m, 3 * 1e-5);
    // On a feature of large form the bias is gone, and the pair that makes the form is no worse
    // than the worst; without calibration errors all pairs are about alike.
    const double spread = std::sqrt(squares - bumpy * bumpy);
    EXPECT_LT(std::abs(bumpy), 0.1 * u->bias_m);
    EXPECT_LT(spread, (1 + 4 / std::sqrt(2.0 * kDraws)) * u->u.total_m);
    if (!calibration) {
      EXPECT_GT(spread, 0.9 * u->u.total_m);
    }
    EXPECT_LT(perfect_spread, 1.05 * u->u.total_m);
  }
}

TEST(PredictUncertainty, CorrelatedTargetsAverageLess) {
  Feature f = Plane(5, 0.04, 1e-5);
  const double alone = PredictUncertainty(f, Measurand::kPosition)->u.total_m;
  f.correlation_length_m = 1e-4;  // far below the spacing of 10 mm
  EXPECT_NEAR(PredictUncertainty(f, Measurand::kPosition)->u.total_m, alone, 1e-15);
  f.correlation_length_m = 10;  // all one
  EXPECT_NEAR(PredictUncertainty(f, Measurand::kPosition)->u.total_m, 1e-5, 1e-8);
  EXPECT_LT(PredictUncertainty(f, Measurand::kForm)->bias_m, 1e-6);
}

TEST(PredictUncertainty, DoesNotDependOnTheFrame) {
  Feature f = Cylinder(0.02, 1.5, 7, 5, true);
  AddScans(f, true);
  const Eigen::Matrix3d turn =
      Eigen::AngleAxisd(0.9, Vector3d(0.3, -0.5, 0.8).normalized()).toRotationMatrix();
  Feature moved = f;
  const Vector3d shift(0.4, 0.1, -0.7);
  for (FeatureTarget& t : moved.targets) {
    t.position_m = turn * t.position_m + shift;
    t.normal = turn * t.normal;
  }
  moved.axis = turn * f.axis;
  moved.axis_point_m = turn * f.axis_point_m + shift;
  for (const Measurand m : {Measurand::kDeviation, Measurand::kForm, Measurand::kSize}) {
    EXPECT_NEAR(PredictUncertainty(moved, m)->u.total_m / PredictUncertainty(f, m)->u.total_m, 1,
                1e-6);
  }
  // Directions are looked at on a grid, which turns along.
  EXPECT_NEAR(PredictUncertainty(moved, Measurand::kPosition)->u.total_m /
                  PredictUncertainty(f, Measurand::kPosition)->u.total_m,
              1, 0.002);
}

TEST(CalibrationDerivatives, AgreeWithFiniteDifferences) {
  const ScanGeometry g = MakeScanGeometry(Rig{}, Measurement{});
  const TriangulationSetup setup = MakeTriangulationSetup(Camera{}, g.camera, g.laser);
  const Vector3d point = 0.01 * g.laser.x_axis + 0.004 * g.laser.z_axis;  // in the sheet
  const Vector3d normal = Vector3d(0.2, -0.1, 1).normalized();
  const CalibrationRow row = CalibrationDerivatives(setup, point, normal);
  const Vector2d px = ProjectPoint(setup, point);
  for (int v = 0; v < kCalibrationVariables; ++v) {
    const double step = v + 2 > kSheetOffset ? 1e-2 : 1e-6;
    TriangulationErrors e = TriangulationErrors::Zero();
    e[v + 2] = step;
    const double difference =
        normal.dot(Triangulate(setup, px, e) - Triangulate(setup, px, -e)) / (2 * step);
    EXPECT_NEAR(row[v], difference, 1e-6 * (1 + std::abs(difference))) << v;
  }
}

// Points of two scans about a target.
std::vector<std::vector<SurfaceObservation>> TwoScans(uint64_t draw) {
  CounterRandom random(5, draw);
  std::vector<std::vector<SurfaceObservation>> scans(2);
  for (size_t s = 0; s < 2; ++s) {
    for (int i = 0; i < 40; ++i) {
      const double x = 8e-3 * (random.Uniform() - 0.5), y = 8e-3 * (random.Uniform() - 0.5);
      scans[s].push_back({{x, y}, s == 0 ? 4e-10 : 9e-10});
    }
  }
  return scans;
}

TEST(SurfaceWeights, BelongToTheDenseUncertainty) {
  const SurfacePrior prior{3e-5, 1.2e-3};
  const std::vector<double> calibration_m2 = {4e-10, 1e-10};
  const auto scans = TwoScans(0);
  const SurfaceWeights w = DenseSurfaceWeights(prior, scans, calibration_m2);
  const SurfaceUncertainty u = DenseSurfaceUncertainty(prior, scans, calibration_m2);
  EXPECT_NEAR(w.uncertainty.total_m / u.total_m, 1, 1e-9);
  EXPECT_NEAR(w.uncertainty.noise_m / u.noise_m, 1, 1e-9);
  EXPECT_NEAR(w.uncertainty.sampling_m / u.sampling_m, 1, 1e-7);
  EXPECT_NEAR(w.uncertainty.calibration_m / u.calibration_m, 1, 1e-9);
  double sum = 0;
  for (const double x : w.of_points[1]) sum += x;
  EXPECT_NEAR(w.of_scans[1], sum, 1e-15);
}

// The weights are those of least mean squared error: any other ones are worse, by the same formula
// written out from the process itself.
TEST(SurfaceWeights, AreTheBestOnes) {
  const SurfacePrior prior{3e-5, 1.2e-3};
  const std::vector<double> calibration_m2 = {4e-10, 1e-10};
  const auto scans = TwoScans(1);
  const SurfaceWeights w = DenseSurfaceWeights(prior, scans, calibration_m2);
  std::vector<Vector2d> places;
  std::vector<double> noise_m2, weights;
  std::vector<size_t> scan_of;
  for (size_t s = 0; s < scans.size(); ++s) {
    for (size_t i = 0; i < scans[s].size(); ++i) {
      if (scans[s][i].place_m.norm() > prior.neighbourhood_m()) {
        EXPECT_EQ(w.of_points[s][i], 0);
        continue;
      }
      places.push_back(scans[s][i].place_m);
      noise_m2.push_back(scans[s][i].noise_variance_m2);
      weights.push_back(w.of_points[s][i]);
      scan_of.push_back(s);
    }
  }
  const auto k = [&](const Vector2d& d) {
    return 9e-10 * std::exp(-d.squaredNorm() / (2 * 1.2e-3 * 1.2e-3));
  };
  const auto mean_squared_error = [&](const std::vector<double>& a) {
    double sum = k({0, 0});
    for (size_t i = 0; i < a.size(); ++i) {
      sum += a[i] * a[i] * noise_m2[i] - 2 * a[i] * k(places[i]);
      for (size_t j = 0; j < a.size(); ++j) {
        sum += a[i] * a[j] *
               (k(places[i] - places[j]) +
                (scan_of[i] == scan_of[j] ? calibration_m2[scan_of[i]] : 0));
      }
    }
    return sum;
  };
  const double best = mean_squared_error(weights);
  EXPECT_NEAR(std::sqrt(best) / w.uncertainty.total_m, 1, 1e-9);
  for (const size_t i : {size_t{0}, size_t{7}, weights.size() - 1}) {
    for (const double step : {-1e-3, 1e-3}) {
      std::vector<double> other = weights;
      other[i] += step;
      EXPECT_GT(mean_squared_error(other), best);
    }
  }
}

TEST(SurfaceWeights, OfNoPointsIsThePrior) {
  const std::vector<std::vector<SurfaceObservation>> scans(2);
  const SurfaceWeights w =
      DenseSurfaceWeights({3e-5, 1.2e-3}, scans, std::vector<double>{1e-10, 1e-10});
  EXPECT_EQ(w.uncertainty.total_m, 3e-5);
  EXPECT_EQ(w.uncertainty.sampling_m, 3e-5);
  EXPECT_EQ(w.of_scans[0], 0);
}

TEST(CheckFeature, NamesWhatIsWrong) {
  Feature f = Plane(3, 0.02, 1e-5);
  f.targets[4].normal = Vector3d(1, 0, 1).normalized();
  EXPECT_THAT(CheckFeature(f).message(), HasSubstr("target 4"));
  f = Plane(3, 0.02, 1e-5);
  f.targets[7].uncertainty.noise_m = std::nan("");
  EXPECT_THAT(CheckFeature(f).message(), AllOf(HasSubstr("target 7"), HasSubstr("noise_m")));
  f = Plane(3, 0.02, 1e-5);
  AddScans(f, false);
  f.scans[1].weights.conservativeResize(8);
  EXPECT_THAT(CheckFeature(f).message(), HasSubstr("scan 1 has 8 weights"));
  f = Plane(3, 0.02, 1e-5);
  AddScans(f, false);
  f.scans[0].covariance(0, 4) = f.scans[0].covariance(4, 0) *= 3;  // correlation 1.8
  EXPECT_THAT(PredictUncertainty(f, Measurand::kPosition).status().message(),
              HasSubstr("covariance of scan 0 is not positive semidefinite"));
  EXPECT_FALSE(CheckFeature(Feature{}).ok());
}

// Verdicts.

TEST(JudgeFeature, ProvesWhatIsKnownWellEnough) {
  const auto c =
      JudgeFeature(Plane(5, 0.04, 1e-5), Measurand::kDeviation, {ZoneKind::kTwoSided, 1e-4});
  ASSERT_TRUE(c.ok()) << c.status();
  EXPECT_TRUE(c->can_be_proven);
  EXPECT_NEAR(c->acceptance_zone_m, 6e-5, 1e-12);
  EXPECT_EQ(c->admissible_share, 1);
  EXPECT_THAT(c->because, HasSubstr("acceptance zone of 60 um is left of 0.1 mm"));
  // Each of the 25 targets keeps 30 um: (2 Phi(3) - 1)^25 = 0.9346; 2000 draws.
  EXPECT_NEAR(c->acceptance_probability, 0.9346, 0.03);
  const auto p = DecisionProbabilities({ZoneKind::kTwoSided, 1e-4}, 1e-5, 2, {0, 1e-4 / 6});
  EXPECT_NEAR(c->probability_wrong_rejection, p->wrong_rejection, 1e-12);
}

TEST(JudgeFeature, NamesTheDominatingPart) {
  Feature f = Plane(5, 0.04, 1e-6);
  AddScans(f, false);
  const auto c = JudgeFeature(f, Measurand::kPosition, {ZoneKind::kTwoSided, 2e-5});
  ASSERT_TRUE(c.ok()) << c.status();
  EXPECT_FALSE(c->can_be_proven);
  EXPECT_LE(c->acceptance_zone_m, 0);
  EXPECT_EQ(c->probability_wrong_acceptance, 0);
  EXPECT_THAT(c->because, AllOf(HasSubstr("calibration"), HasSubstr("no acceptance zone"),
                                HasSubstr("u must be below 4.8")));
  for (FeatureTarget& t : f.targets) t.uncertainty = Independent(1e-6, 1e-3);
  EXPECT_THAT(JudgeFeature(f, Measurand::kPosition, {ZoneKind::kTwoSided, 2e-5})->because,
              HasSubstr("sampling"));
}

TEST(JudgeFeature, NamesTargetsThatAreNotMeasured) {
  Feature f = Plane(5, 0.04, 1e-6);
  for (int i = 0; i < 3; ++i) f.targets[static_cast<size_t>(i)].measured = false;
  ConformanceOptions options;
  for (const Measurand m : {Measurand::kDeviation, Measurand::kForm, Measurand::kPosition}) {
    const auto c = JudgeFeature(f, m, {ZoneKind::kTwoSided, 1e-4}, options);
    ASSERT_TRUE(c.ok());
    EXPECT_FALSE(c->can_be_proven);
    EXPECT_THAT(c->because, HasSubstr("3 of its 25 targets are not measured; 5 % may be"));
  }
  options.required_share = 0.88;
  EXPECT_TRUE(
      JudgeFeature(f, Measurand::kDeviation, {ZoneKind::kTwoSided, 1e-4}, options)->can_be_proven);
  for (FeatureTarget& t : f.targets) t.measured = false;
  const auto none = JudgeFeature(f, Measurand::kForm, {ZoneKind::kOneSided, 1e-4});
  ASSERT_TRUE(none.ok());
  EXPECT_FALSE(none->can_be_proven);
}

TEST(JudgeFeature, RequiredShareDecidesWhichTargetCounts) {
  Feature f = Plane(10, 0.09, 1e-5);
  for (int i = 0; i < 4; ++i) f.targets[static_cast<size_t>(i)].uncertainty.noise_m = 1e-3;
  const ToleranceZone zone{ZoneKind::kTwoSided, 1e-4};
  const auto c = JudgeFeature(f, Measurand::kDeviation, zone);
  EXPECT_TRUE(c->can_be_proven);
  EXPECT_NEAR(c->admissible_share, 0.96, 1e-12);
  EXPECT_NEAR(c->largest_u_m, 1e-3, 1e-12);
  EXPECT_NEAR(c->percentile_95_u_m, 1e-5, 1e-12);
  ConformanceOptions all;
  all.required_share = 1;
  EXPECT_FALSE(JudgeFeature(f, Measurand::kDeviation, zone, all)->can_be_proven);
}

TEST(JudgeFeature, LeastAcceptanceZone) {
  ConformanceOptions options;
  options.rule.least_acceptance_zone = 0.7;
  const auto c = JudgeFeature(Plane(5, 0.04, 1e-5), Measurand::kDeviation,
                              {ZoneKind::kTwoSided, 1e-4}, options);
  EXPECT_FALSE(c->can_be_proven);
  EXPECT_THAT(c->because, HasSubstr("60 um is below the least one of 70 um"));
  EXPECT_EQ(c->admissible_share, 0);
}

TEST(JudgeFeature, BiasNarrowsTheZoneOfForm) {
  const Feature f = Plane(5, 0.04, 1e-5);
  const auto c = JudgeFeature(f, Measurand::kForm, {ZoneKind::kOneSided, 1e-4});
  ASSERT_TRUE(c.ok());
  EXPECT_NEAR(c->acceptance_zone_m, 1e-4 - 2 * c->u.total_m - c->bias_m, 1e-12);
  EXPECT_TRUE(c->can_be_proven);
  EXPECT_GT(c->probability_wrong_rejection, c->probability_wrong_acceptance);
  const auto narrow = JudgeFeature(f, Measurand::kForm, {ZoneKind::kOneSided, 5e-5});
  EXPECT_FALSE(narrow->can_be_proven);
  EXPECT_THAT(narrow->because, HasSubstr("errors alone make a form"));
}

// The admissible uncertainty is where the verdict turns: by the guard bands with a rule that keeps
// most of the zone, else by how often a good part is accepted.
TEST(JudgeFeature, TurnsAtTheAdmissibleUncertainty) {
  struct Case {
    Measurand measurand;
    ToleranceZone zone;
    double least_acceptance_zone;
  };
  for (const Case& at : {Case{Measurand::kDeviation, {ZoneKind::kTwoSided, 1e-4}, 0.9},
                         Case{Measurand::kDeviation, {ZoneKind::kTwoSided, 1e-4}, 0.2},
                         Case{Measurand::kForm, {ZoneKind::kOneSided, 1e-4}, 0.2},
                         Case{Measurand::kPosition, {ZoneKind::kTwoSided, 1e-4}, 0.0}}) {
    ConformanceOptions options;
    options.rule = {1.65, at.least_acceptance_zone};
    // All figures are proportional to the noise.
    const auto unit = JudgeFeature(Plane(5, 0.04, 1e-6), at.measurand, at.zone, options);
    ASSERT_TRUE(unit.ok()) << unit.status();
    const double noise_m = 1e-6 * unit->admissible_u_m / unit->u.total_m;
    for (const double factor : {0.999, 1.001}) {
      const auto c = JudgeFeature(Plane(5, 0.04, factor * noise_m), at.measurand, at.zone, options);
      EXPECT_EQ(c->can_be_proven, factor < 1) << c->because;
    }
    // 25 targets: the largest error decides unless the rule keeps nine tenths of the zone.
    if (at.measurand == Measurand::kDeviation) {
      EXPECT_EQ(unit->admissible_u_m == AdmissibleUncertainty(1e-4, options.rule),
                at.least_acceptance_zone == 0.9);
    }
  }
}

TEST(MeasurandOf, EveryKindThatHasOne) {
  EXPECT_EQ(MeasurandOf(ToleranceKind::kFlatness)->zone, ZoneKind::kOneSided);
  EXPECT_EQ(MeasurandOf(ToleranceKind::kCoaxiality)->measurand, Measurand::kPosition);
  EXPECT_EQ(MeasurandOf(ToleranceKind::kLinearSize)->measurand, Measurand::kSize);
  EXPECT_FALSE(MeasurandOf(ToleranceKind::kTotalRunout));
  EXPECT_FALSE(MeasurandOf(ToleranceKind::kAngularSize));
}

TEST(JudgeFeature, RefusesBadOptions) {
  const Feature f = Plane(3, 0.02, 1e-5);
  const ToleranceZone zone{ZoneKind::kTwoSided, 1e-4};
  ConformanceOptions options;
  options.required_share = 0;
  EXPECT_FALSE(JudgeFeature(f, Measurand::kDeviation, zone, options).ok());
  options = {};
  options.rule.guard_factor = -1;
  EXPECT_FALSE(JudgeFeature(f, Measurand::kDeviation, zone, options).ok());
  EXPECT_FALSE(JudgeFeature(f, Measurand::kDeviation, {ZoneKind::kTwoSided, kInfinity}).ok());
  // A fit that the geometry does not have is a verdict.
  EXPECT_FALSE(JudgeFeature(f, Measurand::kSize, zone)->can_be_proven);
}

}  // namespace
}  // namespace sightline
