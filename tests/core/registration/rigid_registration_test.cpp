// SPDX-License-Identifier: Apache-2.0
#include "core/registration/rigid_registration.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/physics/angle.h"
#include "tests/core/registration/measured_shapes.h"

namespace sightline {
namespace {

constexpr double kNoise_m = 2e-5;

PartPose TruePose(const TriangleMesh& mesh) {
  PartPose pose;
  pose.centre_m = mesh.BoundingBox().center();
  pose.parameters << 0.7 * kRadPerDeg, -0.5 * kRadPerDeg, 0.6 * kRadPerDeg, 1.2e-3, -1.0e-3, 1.1e-3;
  return pose;
}

Registration Found(const SurfaceIndex& index, const SurfaceSample& sample,
                   const RegistrationOptions& options = {}) {
  auto found = RegisterPoints(index, sample.positions_m, sample.normals, options);
  EXPECT_TRUE(found.ok()) << found.status();
  return found.ok() ? *found : Registration{};
}

// Mahalanobis distance of a found pose from the truth, by its covariance.
double Mahalanobis(const Registration& found, const PartPose& truth) {
  const PoseVector error = found.pose.parameters - truth.parameters;
  return std::sqrt(error.dot(found.covariance.ldlt().solve(error)));
}

TEST(RigidRegistration, ExactPointsGiveTheExactPose) {
  const TriangleMesh mesh = StepPart();
  const SurfaceIndex index(mesh);
  CounterRandom random(1, 0);
  const PartPose truth = TruePose(mesh);
  const SurfaceSample sample = Measure(SampleSurface(mesh, 2000, random), truth, 0, random);
  const Registration found = Found(index, sample);
  EXPECT_TRUE(found.converged);
  EXPECT_LT((found.pose.Matrix().matrix() - truth.Matrix().matrix()).cwiseAbs().maxCoeff(), 1e-7);
  EXPECT_EQ(found.not_fixed, 0);
}

// The pose lies within two standard deviations of what was found as often as it says, and the
// covariance is that of the poses found.
TEST(RigidRegistration, CovarianceIsThatOfManyMeasurements) {
  const TriangleMesh mesh = StepPart();
  const SurfaceIndex index(mesh);
  const PartPose truth = TruePose(mesh);
  constexpr int kRuns = 300;
  PoseCovariance spread = PoseCovariance::Zero(), stated = PoseCovariance::Zero();
  PoseVector mean = PoseVector::Zero();
  std::vector<PoseVector> errors;
  int within_all = 0, first_hundred = 0;
  PoseVector within = PoseVector::Zero();
  for (int run = 0; run < kRuns; ++run) {
    CounterRandom random(7, static_cast<uint64_t>(run));
    const SurfaceSample sample =
        Measure(SampleSurface(mesh, 1500, random), truth, kNoise_m, random);
    const Registration found = Found(index, sample);
    const PoseVector error = found.pose.parameters - truth.parameters;
    errors.push_back(error);
    mean += error / kRuns;
    stated += found.covariance / kRuns;
    if (run >= 100) continue;
    ++first_hundred;
    // 95 % of a chi distribution of six degrees of freedom lie below 3.548.
    within_all += Mahalanobis(found, truth) <= 3.548;
    for (int k = 0; k < 6; ++k) {
      within[k] += std::abs(error[k]) <= 2 * std::sqrt(found.covariance(k, k));
    }
  }
  ASSERT_EQ(first_hundred, 100);
  EXPECT_GE(within_all, 90);
  EXPECT_GE(within.minCoeff(), 90);
  for (const PoseVector& error : errors) {
    spread += (error - mean) * (error - mean).transpose() / (kRuns - 1);
  }
  // A variance of 300 draws has a relative standard deviation of 8 %.
  for (int k = 0; k < 6; ++k) {
    EXPECT_NEAR(stated(k, k) / spread(k, k), 1, 0.3) << "parameter " << k;
    EXPECT_LT(std::abs(mean[k]), 5 * std::sqrt(spread(k, k) / kRuns)) << "parameter " << k;
    for (int j = 0; j < k; ++j) {
      const double scale = std::sqrt(spread(k, k) * spread(j, j));
      EXPECT_NEAR(stated(k, j) / scale, spread(k, j) / scale, 0.3) << k << ", " << j;
    }
  }
}

// Most points lie on faces that fix other directions, and lie right after a few steps.
TEST(RigidRegistration, FewPointsThatAloneFixADirectionKeepTheirWeight) {
  const TriangleMesh mesh = StepPart();
  const SurfaceIndex index(mesh);
  PartPose truth;
  truth.centre_m = mesh.BoundingBox().center();
  truth.parameters << 0.2 * kRadPerDeg, -0.1 * kRadPerDeg, 0.2 * kRadPerDeg, 1e-3, 2e-4, -3e-4;
  CounterRandom random(11, 0);
  const SurfaceSample sample = Measure(SampleSurface(mesh, 20'000, random), truth, 5e-6, random);
  SurfaceSample chosen;
  int along_x = 0;
  for (size_t i = 0; i < sample.positions_m.size(); ++i) {
    if (std::abs(sample.normals[i].x()) > 0.5 && ++along_x % 50 != 0) continue;
    chosen.positions_m.push_back(sample.positions_m[i]);
    chosen.normals.push_back(sample.normals[i]);
  }
  const Registration found = Found(index, chosen);
  EXPECT_TRUE(found.converged);
  EXPECT_LT(std::abs(found.pose.parameters[3] - truth.parameters[3]), 1e-5);
}

TEST(RigidRegistration, PlaneLeavesThreeDegreesOfFreedomAtThePrior) {
  const TriangleMesh plate = PlateMesh(0.1, 0.08, 4, 4);
  const SurfaceIndex index(plate);
  CounterRandom random(3, 0);
  PartPose truth;
  truth.centre_m = plate.BoundingBox().center();
  truth.parameters << 0, 0, 0, 0, 0, 1.5e-3;
  SurfaceSample sample = SampleSurface(plate, 4000, random);
  // Only the middle: the plate's border would say where the plate is.
  SurfaceSample middle;
  for (size_t i = 0; i < sample.positions_m.size(); ++i) {
    const Eigen::Vector3d d = sample.positions_m[i] - truth.centre_m;
    if (std::abs(d.x()) > 0.035 || std::abs(d.y()) > 0.025) continue;
    middle.positions_m.push_back(sample.positions_m[i]);
    middle.normals.push_back(sample.normals[i]);
  }
  const Registration found = Found(index, Measure(middle, truth, kNoise_m, random));
  ASSERT_EQ(found.not_fixed, 3);
  const PoseVector prior = RegistrationOptions().prior.StandardDeviations();
  for (int k = 0; k < 3; ++k) {
    const PoseDirection& direction = found.directions[static_cast<size_t>(k)];
    EXPECT_NEAR(direction.standard_deviation_relative, 1, 0.02);
    // Shifts along the plate and the turn about its normal.
    const PoseVector relative = direction.direction.cwiseQuotient(prior);
    EXPECT_NEAR(relative.norm(), 1, 1e-9);
    EXPECT_LT(std::hypot(relative[0], relative[1], relative[5]), 0.05);
  }
  for (const int free : {2, 3, 4}) {
    EXPECT_NEAR(std::sqrt(found.covariance(free, free)), prior[free], 0.02 * prior[free]);
    EXPECT_NEAR(found.pose.parameters[free], 0, 0.05 * prior[free]);
  }
  for (const int fixed : {0, 1, 5}) {
    EXPECT_LT(std::sqrt(found.covariance(fixed, fixed)), 1e-3 * prior[fixed]);
    EXPECT_NEAR(found.pose.parameters[fixed], truth.parameters[fixed],
                3 * std::sqrt(found.covariance(fixed, fixed)))
        << fixed;
  }
}

// A tilted plate may slide along itself and turn about its own normal; nowhere on it does that move
// the surface.
TEST(RigidRegistration, UnfixedMovementsOfATiltedPlaneLeaveItsSurfaceKnown) {
  const TriangleMesh plate = PlateMesh(0.1, 0.08, 4, 4);
  const SurfaceIndex index(plate);
  CounterRandom random(9, 0);
  PartPose truth;
  truth.centre_m = plate.BoundingBox().center();
  truth.parameters << 0.01, -0.008, 0, 0, 0, 1e-3;
  SurfaceSample sample = SampleSurface(PlateMesh(0.05, 0.04, 2, 2), 4000, random);
  for (Eigen::Vector3d& p : sample.positions_m) p += Eigen::Vector3d(0.025, 0.02, 0);
  const Registration found = Found(index, Measure(sample, truth, kNoise_m, random));
  EXPECT_EQ(found.not_fixed, 3);
  for (const double x : {0.03, 0.05, 0.07}) {
    const Eigen::Vector3d place(x, 0.03, 0);
    EXPECT_LT(std::sqrt(PoseVariance(found, place, Eigen::Vector3d::UnitZ())), 5e-6);
    EXPECT_GT(std::sqrt(PoseVariance(found, place, Eigen::Vector3d::UnitX())), 4e-3);
    const Eigen::Vector3d there = found.pose.Matrix() * place;
    EXPECT_LT(std::abs((truth.Matrix().inverse() * there).z()), 1e-5);
  }
}

TEST(RigidRegistration, OrderOfThePointsDoesNotMatter) {
  const TriangleMesh mesh = StepPart();
  const SurfaceIndex index(mesh);
  CounterRandom random(4, 0);
  SurfaceSample sample =
      Measure(SampleSurface(mesh, 1500, random), TruePose(mesh), kNoise_m, random);
  const Registration found = Found(index, sample);
  std::reverse(sample.positions_m.begin(), sample.positions_m.end());
  std::reverse(sample.normals.begin(), sample.normals.end());
  const Registration reversed = Found(index, sample);
  const PoseVector deviations = found.covariance.diagonal().cwiseSqrt();
  EXPECT_LT((found.pose.parameters - reversed.pose.parameters)
                .cwiseQuotient(deviations)
                .cwiseAbs()
                .maxCoeff(),
            0.02);
}

// Turning model and points together turns what is found.
TEST(RigidRegistration, TurnsWithTheFrame) {
  const TriangleMesh mesh = StepPart();
  CounterRandom random(5, 0);
  const PartPose truth = TruePose(mesh);
  SurfaceSample sample = Measure(SampleSurface(mesh, 1500, random), truth, kNoise_m, random);
  const Registration found = Found(SurfaceIndex(mesh), sample);
  const Eigen::Isometry3d frame = Eigen::Translation3d(0.3, -0.2, 0.1) *
                                  Eigen::AngleAxisd(std::numbers::pi / 2, Eigen::Vector3d::UnitX());
  TriangleMesh turned = mesh;
  for (Eigen::Vector3f& p : turned.positions_m) p = (frame * p.cast<double>()).cast<float>();
  for (Eigen::Vector3d& p : sample.positions_m) p = frame * p;
  for (Eigen::Vector3d& n : sample.normals) n = frame.linear() * n;
  const Registration there = Found(SurfaceIndex(turned), sample);
  PoseCovariance both = PoseCovariance::Zero();
  both.topLeftCorner<3, 3>() = frame.linear();
  both.bottomRightCorner<3, 3>() = frame.linear();
  const PoseVector expected = both * found.pose.parameters;
  const PoseVector deviations = there.covariance.diagonal().cwiseSqrt();
  EXPECT_LT((there.pose.parameters - expected).cwiseQuotient(deviations).cwiseAbs().maxCoeff(),
            0.1);
}

TEST(RigidRegistration, BumpsAndStrayPointsDoNotPullIt) {
  const TriangleMesh mesh = StepPart();
  const SurfaceIndex index(mesh);
  CounterRandom random(6, 0);
  const PartPose truth = TruePose(mesh);
  SurfaceSample sample = SampleSurface(mesh, 5000, random);
  for (size_t i = 0; i < sample.positions_m.size(); ++i) {
    if (sample.positions_m[i].x() > 0.065) sample.positions_m[i] += 1e-3 * sample.normals[i];
    if (i % 10 == 0) {
      sample.positions_m[i] +=
          0.01 * Eigen::Vector3d(random.Normal(), random.Normal(), random.Normal());
    }
  }
  const Registration found = Found(index, Measure(sample, truth, kNoise_m, random));
  EXPECT_LT((found.pose.parameters - truth.parameters).head<3>().norm(), 3e-4);
  EXPECT_LT((found.pose.parameters - truth.parameters).tail<3>().norm(), 1.5e-5);
}

// Noise of a millimetre brings points near an edge from one face to the other. With the noise known
// the pose stays within its covariance all the same, and noisier points count for less.
TEST(RigidRegistration, NoiseBeyondEdgesDoesNotBiasIt) {
  TriangleMesh mesh = StepPart();
  for (Eigen::Vector3f& p : mesh.positions_m) p *= 3;
  const SurfaceIndex index(mesh);
  const PartPose truth = TruePose(mesh);
  int within = 0;
  for (uint64_t run = 0; run < 40; ++run) {
    CounterRandom random(17, run);
    SurfaceSample sample = SampleSurface(mesh, 4000, random);
    std::vector<double> sigma_m;
    for (Eigen::Vector3d& p : sample.positions_m) {
      sigma_m.push_back(random.Uniform() < 0.5 ? 1e-3 : 1e-4);
      p += sigma_m.back() * Eigen::Vector3d(random.Normal(), random.Normal(), random.Normal());
    }
    RegistrationOptions options;
    options.noise_m2 = [&](size_t i) -> Eigen::Matrix3d {
      return sigma_m[i] * sigma_m[i] * Eigen::Matrix3d::Identity();
    };
    const Registration found = Found(index, Measure(sample, truth, 0, random), options);
    within += Mahalanobis(found, truth) <= 3.548;
    EXPECT_LT(std::sqrt(found.covariance(3, 3)), 1e-5);
  }
  EXPECT_GE(within, 34);
}

TEST(RigidRegistration, PointsOfAnotherSideOfAThinWallAreNotMixedUp) {
  const TriangleMesh wall = BoxMesh({0, 0, 0}, {0.05f, 0.04f, 0.001f});
  const SurfaceIndex index(wall);
  CounterRandom random(8, 0);
  PartPose truth;
  truth.centre_m = wall.BoundingBox().center();
  truth.parameters << 0, 0, 0, 0, 0, 0.0009;
  const SurfaceSample sample = Measure(SampleSurface(wall, 3000, random), truth, 1e-6, random);
  EXPECT_NEAR(Found(index, sample).pose.parameters[5], 0.0009, 1e-6);
}

TEST(RigidRegistration, VarianceAtAPlaceIsThatOfItsMovement) {
  Registration found;
  found.pose.centre_m = Eigen::Vector3d(0.01, 0.02, 0.03);
  found.covariance = PoseCovariance::Zero();
  found.covariance(2, 2) = 1e-6;  // 1 mrad about z
  found.covariance(4, 4) = 4e-10;
  const Eigen::Vector3d place = found.pose.centre_m + Eigen::Vector3d(0.1, 0, 0);
  EXPECT_NEAR(PoseVariance(found, place, Eigen::Vector3d::UnitY()), 1e-8 + 4e-10, 1e-15);
  EXPECT_NEAR(PoseVariance(found, place, Eigen::Vector3d::UnitZ()), 0, 1e-15);
}

TEST(RigidRegistration, BadInputIsRefused) {
  const TriangleMesh mesh = StepPart();
  const SurfaceIndex index(mesh);
  const std::vector<Eigen::Vector3d> few(5, Eigen::Vector3d::Zero());
  EXPECT_EQ(RegisterPoints(index, few, {}, {}).status().code(), absl::StatusCode::kInvalidArgument);
  const std::vector<Eigen::Vector3d> far(100, Eigen::Vector3d(1, 1, 1));
  EXPECT_EQ(RegisterPoints(index, far, {}, {}).status().code(),
            absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(RegisterPoints(index, far, few, {}).status().code(),
            absl::StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace sightline
