// SPDX-License-Identifier: Apache-2.0
// Errors that targets share, against simulated measurements that are joined by an independent fit.
#include "core/shared_errors/shared_errors.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <cmath>
#include <vector>

#include "core/random/counter_random.h"

namespace sightline {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

// Targets all over an ellipsoid with axes of 100, 60 and 40 mm: any two frames that share enough of
// it determine their relative pose.
struct Part {
  std::vector<Eigen::Vector3f> positions_m, normals;

  Part() {
    const Vector3d half(0.05, 0.03, 0.02);
    CounterRandom random(3, 0);
    for (int k = 0; k < 180; ++k) {
      Vector3d n;
      for (int i = 0; i < 3; ++i) n[i] = random.Normal();
      n.normalize();
      const Vector3d scaled = half.cwiseProduct(n);
      positions_m.push_back((half.cwiseProduct(scaled) / scaled.norm()).cast<float>());
      normals.push_back(n.cast<float>());
    }
  }
};

// A scan that sees the targets whose normals have a component along `direction`.
ScanShare Look(const Part& part, const Vector3d& direction, size_t place, size_t frame,
               uint64_t seed) {
  ScanShare scan;
  scan.place = place;
  scan.frame = frame;
  CounterRandom random(seed, 1);
  for (size_t t = 0; t < part.normals.size(); ++t) {
    if (part.normals[t].cast<double>().dot(direction.normalized()) < 0.2) continue;
    scan.targets.push_back(static_cast<uint32_t>(t));
    scan.information.push_back(static_cast<float>(0.5 + random.Uniform()));
    // Derivatives that vary over the surface, as of a rig 0.3 m away.
    const Vector3d p = part.positions_m[t].cast<double>(), n = part.normals[t].cast<double>();
    Eigen::Matrix<float, 1, kCalibrationVariables> row;
    for (int k = 0; k < kCalibrationVariables; ++k) {
      row[k] = static_cast<float>((k < 3 ? 0.3 : 1) * std::sin(k + 8 * p.x() + 11 * p.y() * k) *
                                  (0.5 + n.z() * n.z()) * (k < 9 ? 1 : 1e-4));
    }
    scan.derivatives.push_back(row);
  }
  return scan;
}

CalibrationCovariance SomeCalibration() {
  CalibrationCovariance c = CalibrationCovariance::Zero();
  for (int k = 0; k < kCalibrationVariables; ++k) {
    const double s = k < 3 ? 5e-5 : k < 9 ? 1e-5 : 0.1;
    c(k, k) = s * s;
  }
  c(0, 4) = c(4, 0) = 0.6 * 5e-5 * 1e-5;
  return c;
}

// Three frames from three places that overlap pairwise.
SharedErrorsInput Input(const Part& part) {
  SharedErrorsInput input;
  input.positions_m = part.positions_m;
  input.normals = part.normals;
  input.scans.push_back(Look(part, {1, 0.6, 1}, 0, 0, 1));
  input.scans.push_back(Look(part, {0.4, 1, 1}, 0, 0, 2));
  input.scans.push_back(Look(part, {1, 1, -0.8}, 1, 1, 3));
  input.scans.push_back(Look(part, {-1, 0.7, -0.6}, 2, 2, 4));
  input.scans.push_back(Look(part, {-1, -1, 0.9}, 2, 2, 5));
  input.method = RegistrationMethod::kBestFit;
  input.pose = {.angle_rad = 0.01, .position_m = 2e-3};
  input.independent_m2.assign(part.positions_m.size(), 1e-10);
  return input;
}

Eigen::Matrix<double, 1, 6> PoseRow(const Part& part, size_t t) {
  const Vector3d n = part.normals[t].cast<double>();
  Eigen::Matrix<double, 1, 6> row;
  row << part.positions_m[t].cast<double>().cross(n).transpose(), n.transpose();
  return row;
}

// Errors of the joined estimates of all targets in one simulated measurement. Every scan measures
// every target with independent errors whose weighted mean has the stated variance; surface and
// poses are then fitted to all measurements in one dense least-squares problem, and the motion that
// fits best to the model is taken off.
VectorXd SimulateJoined(const Part& part, const SharedErrorsInput& input, uint64_t draw) {
  const auto count = static_cast<Eigen::Index>(part.positions_m.size());
  const Eigen::Index frames = 3, unknowns = count + 6 * frames;
  CounterRandom random(17, draw);
  const MatrixXd own_root =
      input.calibration.topLeftCorner<kPlaceVariables, kPlaceVariables>().llt().matrixL();
  std::vector<VectorXd> calibration;
  const VectorXd lens = VectorXd::NullaryExpr(3, [&] {
                          return random.Normal();
                        }).cwiseProduct(input.calibration.diagonal().tail<3>().cwiseSqrt());
  for (int place = 0; place < 3; ++place) {
    VectorXd errors(kCalibrationVariables);
    errors << own_root * VectorXd::NullaryExpr(kPlaceVariables, [&] { return random.Normal(); }),
        lens;
    calibration.push_back(errors);
  }
  VectorXd pose(6 * frames);
  for (Eigen::Index k = 0; k < pose.size(); ++k) {
    pose[k] = random.Normal() * (k % 6 < 3 ? input.pose.angle_rad : input.pose.position_m);
  }
  std::vector<double> sum(part.positions_m.size(), 0);
  for (const ScanShare& scan : input.scans) {
    for (size_t i = 0; i < scan.targets.size(); ++i) sum[scan.targets[i]] += scan.information[i];
  }
  MatrixXd normal = MatrixXd::Zero(unknowns, unknowns);
  VectorXd right = VectorXd::Zero(unknowns);
  for (const ScanShare& scan : input.scans) {
    const auto at = count + 6 * static_cast<Eigen::Index>(scan.frame);
    for (size_t i = 0; i < scan.targets.size(); ++i) {
      const uint32_t t = scan.targets[i];
      const double information = scan.information[i] / sum[t] / input.independent_m2[t];
      const Eigen::Matrix<double, 1, 6> a = PoseRow(part, t);
      const double measured =
          scan.derivatives[i].cast<double>().dot(calibration[scan.place].transpose()) +
          a.dot(pose.segment<6>(at - count).transpose()) + random.Normal() / std::sqrt(information);
      normal(t, t) += information;
      normal.block<1, 6>(t, at) += information * a;
      normal.block<6, 1>(at, t) += information * a.transpose();
      normal.block<6, 6>(at, at) += information * a.transpose() * a;
      right[t] += information * measured;
      right.segment<6>(at) += information * measured * a.transpose();
    }
  }
  for (Eigen::Index k = 0; k < 6 * frames; ++k) {
    const double s = k % 6 < 3 ? input.pose.angle_rad : input.pose.position_m;
    normal(count + k, count + k) += 1 / (s * s);
  }
  // A target that nothing measures has no estimate.
  for (Eigen::Index t = 0; t < count; ++t) {
    if (sum[static_cast<size_t>(t)] == 0) normal(t, t) = 1;
  }
  const VectorXd fitted = normal.ldlt().solve(right);
  // The coordinate system is the best fit of all that the scans share to the model.
  MatrixXd seen = MatrixXd::Zero(6, 6);
  VectorXd moved = VectorXd::Zero(6);
  for (const ScanShare& scan : input.scans) {
    const Eigen::Index f = 6 * static_cast<Eigen::Index>(scan.frame);
    for (size_t i = 0; i < scan.targets.size(); ++i) {
      const uint32_t t = scan.targets[i];
      const double information = scan.information[i] / sum[t] / input.independent_m2[t];
      const Eigen::Matrix<double, 1, 6> a = PoseRow(part, t);
      seen += information * a.transpose() * a;
      moved += information * a.transpose() *
               (a * (pose.segment<6>(f) - fitted.segment<6>(count + f)) +
                scan.derivatives[i].cast<double>() * calibration[scan.place]);
    }
  }
  const VectorXd common = seen.ldlt().solve(moved);
  VectorXd errors(count);
  for (Eigen::Index t = 0; t < count; ++t) {
    errors[t] = fitted[t] - PoseRow(part, static_cast<size_t>(t)) * common;
  }
  return errors;
}

TEST(SharedErrors, AgreeWithSimulatedMeasurementsThatAreJoined) {
  const Part part;
  for (const bool calibrated : {false, true}) {
    SharedErrorsInput input = Input(part);
    if (calibrated) input.calibration = SomeCalibration();
    const SharedErrors errors(input);
    constexpr int kSimulations = 1500;
    VectorXd squares = VectorXd::Zero(static_cast<Eigen::Index>(part.positions_m.size()));
    for (int d = 0; d < kSimulations; ++d) {
      squares += SimulateJoined(part, input, static_cast<uint64_t>(d)).cwiseAbs2();
    }
    double ratios = 0;
    int seen = 0;
    for (uint32_t t = 0; t < part.positions_m.size(); ++t) {
      SharedErrors::AtTarget shared;
      if (!errors.Evaluate(t, &shared)) continue;
      const double predicted = std::sqrt(1e-10 + shared.calibration_m * shared.calibration_m +
                                         shared.registration_m * shared.registration_m);
      const double simulated = std::sqrt(squares[t] / kSimulations);
      // Four standard errors of a standard deviation from so many draws.
      EXPECT_NEAR(simulated / predicted, 1, 4 / std::sqrt(2.0 * kSimulations)) << "target " << t;
      ratios += simulated / predicted;
      ++seen;
    }
    EXPECT_GT(seen, 100);
    EXPECT_NEAR(ratios / seen, 1, 0.02);
  }
}

TEST(SharedErrors, OneFrameIsFittedToTheModelOnly) {
  const Part part;
  SharedErrorsInput input = Input(part);
  for (ScanShare& scan : input.scans) scan.frame = 0;
  input.calibration = SomeCalibration();
  const SharedErrors fitted(input);
  // Errors of the calibration that move the part as a whole leave nothing.
  for (ScanShare& scan : input.scans) {
    scan.place = 0;
    for (size_t i = 0; i < scan.targets.size(); ++i) {
      scan.derivatives[i].setZero();
      scan.derivatives[i].head<6>() = PoseRow(part, scan.targets[i]).cast<float>();
    }
  }
  const SharedErrors rigid(input);
  input.method = RegistrationMethod::kNone;
  const SharedErrors exact(input);
  double largest_m = 0;
  for (uint32_t t = 0; t < part.positions_m.size(); ++t) {
    SharedErrors::AtTarget a, b, c;
    if (!fitted.Evaluate(t, &a)) continue;
    ASSERT_TRUE(rigid.Evaluate(t, &b) && exact.Evaluate(t, &c));
    EXPECT_LT(a.registration_m, 1e-9);
    EXPECT_GT(a.calibration_m, 1e-6);
    EXPECT_LT(b.calibration_m, 1e-9);
    largest_m = std::max(largest_m, c.calibration_m);
  }
  EXPECT_GT(largest_m, 1e-5);
}

TEST(SharedErrors, ScansOfOnePlaceDoNotAverageItsErrors) {
  const Part part;
  SharedErrorsInput input = Input(part);
  input.method = RegistrationMethod::kNone;
  input.calibration = SomeCalibration();
  input.calibration.bottomRightCorner<3, 3>().setZero();
  const ScanShare first = input.scans[0];
  input.scans.assign(4, first);
  const SharedErrors one_place(input);
  for (size_t s = 0; s < 4; ++s) input.scans[s].place = s;
  const SharedErrors four_places(input);
  input.scans.resize(1);
  const SharedErrors one_scan(input);
  for (const uint32_t t : first.targets) {
    SharedErrors::AtTarget a, b, c;
    ASSERT_TRUE(one_place.Evaluate(t, &a) && four_places.Evaluate(t, &b) &&
                one_scan.Evaluate(t, &c));
    EXPECT_NEAR(a.calibration_m, c.calibration_m, 1e-12);
    EXPECT_NEAR(b.calibration_m, 0.5 * c.calibration_m, 1e-12);
  }
}

TEST(SharedErrors, WithoutOverlapAFrameIsAsUncertainAsItIsPlaced) {
  const Part part;
  SharedErrorsInput input = Input(part);
  input.scans.clear();
  input.scans.push_back(Look(part, {0, 0, 1}, 0, 0, 1));
  input.scans.push_back(Look(part, {0, 0, -1}, 1, 1, 2));
  const SharedErrors errors(input);
  ASSERT_EQ(errors.frames().size(), 2u);
  for (const FrameRegistration& frame : errors.frames()) {
    EXPECT_EQ(frame.overlap_targets, 0);
    EXPECT_FALSE(frame.determined);
    EXPECT_FALSE(frame.joined);
    // The order is that of the placing errors: what both frames do alike is no error of joining
    // them.
    EXPECT_GT(frame.standard_uncertainty_m, 0.25 * input.pose.position_m);
    EXPECT_LT(frame.standard_uncertainty_m, input.pose.position_m);
  }
  // The result is the same if the fit may not use what they share.
  SharedErrorsInput unused = Input(part);
  unused.used.assign(part.positions_m.size(), false);
  const SharedErrors without(unused);
  for (const FrameRegistration& frame : without.frames()) EXPECT_FALSE(frame.determined);
}

// Datum features that one frame sees alone: they define the coordinate system, so that its own pose
// has no error, and nothing joins the other frames to it.
TEST(SharedErrors, DatumsOfASingleFrameJoinNothing) {
  const Part part;
  SharedErrorsInput input = Input(part);
  input.method = RegistrationMethod::kDatumFeatures;
  input.used.assign(part.positions_m.size(), false);
  std::vector<int> seen(part.positions_m.size(), 0);  // by frames, as bits
  for (const ScanShare& scan : input.scans) {
    for (const uint32_t t : scan.targets) seen[t] |= 1 << scan.frame;
  }
  for (size_t t = 0; t < seen.size(); ++t) input.used[t] = seen[t] == 1;
  const SharedErrors errors(input);
  for (const FrameRegistration& frame : errors.frames()) {
    EXPECT_EQ(frame.overlap_targets, 0);
    EXPECT_FALSE(frame.joined);
    EXPECT_FALSE(frame.determined);
  }
  EXPECT_LT(errors.frames()[0].standard_uncertainty_m, 1e-9);
  EXPECT_GT(errors.frames()[1].standard_uncertainty_m, input.pose.position_m);
  const SharedErrors by_overlap(Input(part));
  for (const FrameRegistration& frame : by_overlap.frames()) EXPECT_TRUE(frame.joined);
}

TEST(SharedErrors, OverlapAndInformationJoinFramesBetter) {
  const Part part;
  SharedErrorsInput input = Input(part);
  const SharedErrors all(input);
  for (double& variance : input.independent_m2) variance *= 4;
  const SharedErrors noisy(input);
  input = Input(part);
  input.correlation_length_m = 0.01;
  const SharedErrors correlated(input);
  input = Input(part);
  for (size_t t = 0; t < part.positions_m.size(); ++t) input.used.push_back(t % 4 == 0);
  const SharedErrors quarter(input);
  for (size_t f = 0; f < 3; ++f) {
    const double u_m = all.frames()[f].standard_uncertainty_m;
    EXPECT_TRUE(all.frames()[f].determined);
    EXPECT_LT(u_m, 1e-5);  // less than that of one target
    EXPECT_NEAR(noisy.frames()[f].standard_uncertainty_m, 2 * u_m, 0.02 * u_m);
    EXPECT_GT(correlated.frames()[f].standard_uncertainty_m, 1.1 * u_m);
    EXPECT_GT(quarter.frames()[f].standard_uncertainty_m, 1.5 * u_m);
  }
}

TEST(SharedErrors, KnownPosesAreIndependentErrorsOfEveryFrame) {
  const Part part;
  SharedErrorsInput input = Input(part);
  input.method = RegistrationMethod::kKnownPoses;
  input.pose = {.angle_rad = 1e-4, .position_m = 5e-6};
  const ScanShare first = input.scans[0];
  input.scans = {first};
  const SharedErrors errors(input);
  Eigen::AlignedBox3f box;
  for (const Eigen::Vector3f& p : part.positions_m) box.extend(p);
  for (const uint32_t t : first.targets) {
    SharedErrors::AtTarget shared;
    ASSERT_TRUE(errors.Evaluate(t, &shared));
    const Vector3d arm = (part.positions_m[t] - box.center()).cast<double>();
    const double turn = arm.cross(part.normals[t].cast<double>()).norm();
    EXPECT_NEAR(shared.registration_m, std::hypot(1e-4 * turn, 5e-6), 1e-11);
  }
}

}  // namespace
}  // namespace sightline
