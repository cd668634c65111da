// SPDX-License-Identifier: Apache-2.0
#include "core/scanner_calibration/rig_adjustment.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <string>

#include "core/scanner_calibration/left_out_frames.h"
#include "core/scanner_calibration/planning_rig.h"
#include "tests/core/scanner_calibration/synthetic_scanner.h"

namespace sightline {
namespace {

using testing::HasSubstr;

// chi^2 per degree of freedom of the laser plane and of both focal lengths about the truth, mean
// over seeds.
struct MeanChiSquare {
  double plane = 0, focal = 0;
};

MeanChiSquare ChiSquareOver(int seeds, int frames, const SyntheticErrors& errors) {
  MeanChiSquare mean;
  for (int seed = 1; seed <= seeds; ++seed) {
    const SyntheticScanner scanner =
        MakeSyntheticScanner(frames, errors, static_cast<uint32_t>(seed));
    const auto rig = AdjustRig(scanner.board, scanner.frames, scanner.open, TargetShape::kFlat);
    EXPECT_TRUE(rig.ok()) << rig.status();
    if (!rig.ok()) return mean;
    const Eigen::VectorXd off = rig->shared - scanner.shared;
    const Eigen::Matrix3d plane = rig->covariance.block<3, 3>(kPlaneX, kPlaneX);
    const Eigen::Matrix2d focal = rig->covariance.topLeftCorner<2, 2>();
    const Eigen::Vector3d plane_off = off.segment<3>(kPlaneX);
    const Eigen::Vector2d focal_off = off.head<2>();
    mean.plane += plane_off.dot(plane.ldlt().solve(plane_off)) / 3 / seeds;
    mean.focal += focal_off.dot(focal.ldlt().solve(focal_off)) / 2 / seeds;
  }
  return mean;
}

// With 30 seeds the mean of chi^2 / 3 has a standard deviation of 0.15, of chi^2 / 2 of 0.18.
TEST(RigAdjustment, ErrsAsItsCovarianceSaysWhereErrorsAreIndependent) {
  const MeanChiSquare mean = ChiSquareOver(30, 12, {});
  RecordProperty("plane", std::to_string(mean.plane));
  EXPECT_GT(mean.plane, 0.4) << "plane " << mean.plane << " focal " << mean.focal;
  EXPECT_LT(mean.plane, 1.6);
  EXPECT_GT(mean.focal, 0.4);
  EXPECT_LT(mean.focal, 1.6);
}

// Samples along a line that are shifted together, 60 of them: a covariance that took them as
// independent would be far too small.
TEST(RigAdjustment, ErrsAsItsCovarianceSaysWhereAFrameHasACommonError) {
  const MeanChiSquare mean = ChiSquareOver(30, 12, {.line_shift_px = 0.4, .line_turn_px = 0.4});
  EXPECT_GT(mean.plane, 0.4) << "plane " << mean.plane << " focal " << mean.focal;
  EXPECT_LT(mean.plane, 1.8);
  EXPECT_GT(mean.focal, 0.3);
  EXPECT_LT(mean.focal, 1.8);
}

TEST(RigAdjustment, DoesNotDependOnTheOrderOfFrames) {
  SyntheticScanner scanner = MakeSyntheticScanner(8, {.line_shift_px = 0.2}, 3);
  const auto rig = AdjustRig(scanner.board, scanner.frames, scanner.open, TargetShape::kFlat);
  std::reverse(scanner.frames.begin(), scanner.frames.end());
  const auto reversed = AdjustRig(scanner.board, scanner.frames, scanner.open, TargetShape::kFlat);
  ASSERT_TRUE(rig.ok() && reversed.ok());
  for (int i = 0; i < kSharedParameters; ++i) {
    const double sd = std::sqrt(rig->covariance(i, i));
    EXPECT_NEAR(rig->shared[i], reversed->shared[i], 0.01 * sd) << i;
    EXPECT_NEAR(std::sqrt(reversed->covariance(i, i)), sd, 0.01 * sd) << i;
  }
}

// A board of other size: the camera stays, the plane moves in proportion.
TEST(RigAdjustment, LengthsFollowTheSquares) {
  SyntheticScanner scanner = MakeSyntheticScanner(8, {}, 4);
  const auto rig = AdjustRig(scanner.board, scanner.frames, scanner.open, TargetShape::kFlat);
  scanner.board.square_m *= 2;
  for (CalibrationFrame& frame : scanner.frames) frame.pose.tail<3>() *= 2;
  const auto twice = AdjustRig(scanner.board, scanner.frames, scanner.open, TargetShape::kFlat);
  ASSERT_TRUE(rig.ok() && twice.ok());
  EXPECT_NEAR(rig->shared[kFocalX], twice->shared[kFocalX],
              0.02 * std::sqrt(rig->covariance(kFocalX, kFocalX)));
  const Eigen::Vector3d plane = rig->shared.segment<3>(kPlaneX);
  EXPECT_LT((2 * twice->shared.segment<3>(kPlaneX) - plane).norm(),
            0.02 * std::sqrt(rig->covariance.block<3, 3>(kPlaneX, kPlaneX).trace()));
}

TEST(RigAdjustment, SaysThatFramesAreTooFew) {
  SyntheticScanner scanner = MakeSyntheticScanner(2, {}, 1);
  const auto two = AdjustRig(scanner.board, scanner.frames, scanner.open, TargetShape::kFlat);
  EXPECT_EQ(two.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(two.status().message()), HasSubstr("three frames"));
}

// Real and predicted scatter of frames that were left out agree, with independent and with common
// errors.
TEST(LeftOutFrames, ScatterAsPredicted) {
  for (const SyntheticErrors& errors :
       {SyntheticErrors{}, SyntheticErrors{.line_shift_px = 0.4, .line_turn_px = 0.4}}) {
    double real = 0, predicted = 0;
    for (uint32_t seed = 1; seed <= 3; ++seed) {
      const SyntheticScanner scanner = MakeSyntheticScanner(10, errors, seed);
      std::vector<LeftOutFrame> left_out;
      for (size_t i = 0; i < scanner.frames.size(); ++i) {
        const auto frame =
            PredictLeftOut(scanner.board, scanner.frames, i, scanner.open, TargetShape::kFlat);
        ASSERT_TRUE(frame.ok()) << frame.status();
        real += frame->rms_m * frame->rms_m;
        predicted += frame->predicted_rms_m * frame->predicted_rms_m;
        left_out.push_back(*frame);
      }
      const ScatterRatio ratio = RealOverPredicted(left_out);
      EXPECT_LT(ratio.low, ratio.value);
      EXPECT_LT(ratio.value, ratio.high);
    }
    EXPECT_GT(std::sqrt(real / predicted), 0.7) << errors.line_shift_px;
    EXPECT_LT(std::sqrt(real / predicted), 1.4) << errors.line_shift_px;
  }
}

double LeftOutRms_m(const SyntheticScanner& scanner, TargetShape shape) {
  double sum = 0;
  for (size_t i = 0; i < scanner.frames.size(); ++i) {
    const auto frame = PredictLeftOut(scanner.board, scanner.frames, i, scanner.open, shape);
    EXPECT_TRUE(frame.ok()) << frame.status();
    if (frame.ok()) sum += frame->rms_m * frame->rms_m / static_cast<double>(scanner.frames.size());
  }
  return std::sqrt(sum);
}

// A sheet that is twisted by 0.3 mm at its corners: leaving frames out shows it, and the shape that
// made the frames predicts them best.
TEST(LeftOutFrames, ArePredictedBestWithTheShapeOfTheTarget) {
  const SyntheticScanner scanner = MakeSyntheticScanner(8, {.twist_per_m = -0.4}, 5);
  const auto rig = AdjustRig(scanner.board, scanner.frames, scanner.open, TargetShape::kBentBoard);
  ASSERT_TRUE(rig.ok()) << rig.status();
  EXPECT_NEAR(rig->shared[kBendXy], -0.4, 4 * std::sqrt(rig->covariance(kBendXy, kBendXy)));
  EXPECT_NEAR(rig->shared[kFocalX], 1370, 4 * std::sqrt(rig->covariance(kFocalX, kFocalX)));
  const double bent_board_m = LeftOutRms_m(scanner, TargetShape::kBentBoard);
  EXPECT_LT(bent_board_m, 0.8 * LeftOutRms_m(scanner, TargetShape::kFlat));
  EXPECT_LT(bent_board_m, 0.8 * LeftOutRms_m(scanner, TargetShape::kBent));
}

TEST(PlanningRig, PointsHaveTheCovarianceOfTheCalibration) {
  SyntheticScanner scanner = MakeSyntheticScanner(10, {}, 2);
  // The variables have no distortion and one focal length: with a camera known to that extent,
  // nothing is missed.
  scanner.open.camera = CameraOf(scanner.shared);
  for (size_t i = 4; i < 9; ++i) scanner.open.standard_deviation[i] = 0;
  const auto rig = AdjustRig(scanner.board, scanner.frames, scanner.open, TargetShape::kFlat);
  ASSERT_TRUE(rig.ok());
  const auto described = DescribeForPlanning(*rig, 1280, 1024);
  ASSERT_TRUE(described.ok()) << described.status();
  EXPECT_NEAR(described->triangulation_angle_rad, 37 * 3.14159 / 180, 0.05);
  EXPECT_NEAR(described->camera_distance_m, 0.3, 0.03);
  EXPECT_LT(described->covariance_misfit, 0.1);
  EXPECT_EQ(described->covariance.rows(), 12);
}

// Against scanners that are adjusted to other frames each: the errors are of other seeds.
TEST(PlanningRig, DistanceAndAngleScatterByTheirStandardErrors) {
  const SyntheticScanner truth = MakeSyntheticScanner(10, {}, 1);
  AdjustedRig exact;
  exact.shared = truth.shared;
  exact.covariance = Eigen::MatrixXd::Zero(kSharedParameters, kSharedParameters);
  const auto nominal = DescribeForPlanning(exact, 1280, 1024);
  ASSERT_TRUE(nominal.ok()) << nominal.status();
  constexpr int kSeeds = 12;
  double distance = 0, angle = 0;
  for (int seed = 1; seed <= kSeeds; ++seed) {
    const SyntheticScanner scanner = MakeSyntheticScanner(10, {}, 20 + seed);
    const auto rig = AdjustRig(scanner.board, scanner.frames, scanner.open, TargetShape::kFlat);
    ASSERT_TRUE(rig.ok()) << rig.status();
    const auto described = DescribeForPlanning(*rig, 1280, 1024);
    ASSERT_TRUE(described.ok()) << described.status();
    const auto square = [](double off, double error) { return off * off / (error * error); };
    distance += square(described->camera_distance_m - nominal->camera_distance_m,
                       described->camera_distance_error_m) /
                kSeeds;
    angle += square(described->triangulation_angle_rad - nominal->triangulation_angle_rad,
                    described->triangulation_angle_error_rad) /
             kSeeds;
  }
  // Mean of 12 chi^2 of one degree of freedom: 99.9 % of such means lie within these limits; the
  // covariance by ten frames adds to the scatter.
  EXPECT_GT(distance, 0.15);
  EXPECT_LT(distance, 3.5);
  EXPECT_GT(angle, 0.15);
  EXPECT_LT(angle, 3.5);
}

}  // namespace
}  // namespace sightline
