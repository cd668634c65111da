// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/expectation/texture_law.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <cmath>
#include <functional>

#include "core/random/counter_random.h"
#include "render_worker/effects/effect.h"
#include "render_worker/plate/plate_scene.h"

namespace sightline {
namespace {

FrameSetup ThinLine() {
  FrameSetup frame;
  frame.laser.divergence_rad = 0.02;  // its width averages little out
  frame.plate.laser_distance_m = frame.laser.beam_focus_distance_m;
  return frame;
}

// Mean of `correlation` of all pairs of points of two stretches.
double MeanOverPairs(const std::function<double(double)>& correlation, double length_m,
                     double distance_m) {
  constexpr int kPoints = 400;
  double sum = 0;
  for (int i = 0; i < kPoints; ++i) {
    for (int j = 0; j < kPoints; ++j) {
      sum += correlation(distance_m + length_m * (i - j) / kPoints);
    }
  }
  return sum / (kPoints * kPoints);
}

TEST(TextureLaw, StretchesAreAsAlikeAsTheirPoints) {
  constexpr double kRms = 0.2, kCorrelation_m = 2e-3;
  const FrameSetup frame = ThinLine();
  const TextureLaw exponential(RandomLaw::kExponentialReflectance, frame, {kRms, kCorrelation_m});
  const auto correlation = [](double x_m) {
    return kRms * kRms * std::exp(-std::abs(x_m) / kCorrelation_m);
  };
  for (const double length_m : {5e-4, 4e-3}) {
    for (const double blocks : {0, 1, 3}) {
      const double expected = MeanOverPairs(correlation, length_m, blocks * length_m);
      EXPECT_NEAR(exponential.Covariance(length_m, blocks * length_m), expected, 0.01 * expected)
          << length_m << " " << blocks;
    }
  }
}

TEST(TextureLaw, WhatBlocksDoNotShareVariesWithinThem) {
  constexpr double kRms = 0.2, kBlock_m = 3e-3;
  for (const RandomLaw law :
       {RandomLaw::kGaussianReflectance, RandomLaw::kExponentialReflectance}) {
    for (const double correlation_m : {1e-4, 1e-3, 1e-2}) {
      const TextureLaw texture(law, ThinLine(), {kRms, correlation_m});
      const double along = texture.VarianceAlong(kBlock_m);
      EXPECT_GT(along, 0) << static_cast<int>(law);
      EXPECT_NEAR(texture.Covariance(kBlock_m, 0) + along,
                  texture.Covariance(1e-3 * correlation_m, 0), 1e-3 * kRms * kRms)
          << static_cast<int>(law);
    }
    // A field that is smooth over a block does not vary in it, one that is fine only there.
    EXPECT_LT(TextureLaw(law, ThinLine(), {kRms, 1}).VarianceAlong(kBlock_m), 2e-3 * kRms * kRms);
    EXPECT_LT(TextureLaw(law, ThinLine(), {kRms, 1e-5}).Covariance(kBlock_m, 0),
              0.01 * kRms * kRms);
  }
}

// Drawn fields' variance about their mean, by the square root of their covariance.
TEST(TextureLaw, FewLengthsOfTheFieldVaryMoreOrLess) {
  constexpr double kLength_m = 6e-3;
  constexpr int kParts = 60, kDraws = 20000;
  for (const RandomLaw law :
       {RandomLaw::kGaussianReflectance, RandomLaw::kExponentialReflectance}) {
    const TextureLaw texture(law, ThinLine(), {0.3, 2e-3});
    Eigen::MatrixXd covariance(kParts, kParts);
    for (int i = 0; i < kParts; ++i) {
      for (int j = 0; j < kParts; ++j) {
        covariance(i, j) = texture.Covariance(kLength_m / kParts, (i - j) * kLength_m / kParts);
      }
    }
    covariance.diagonal().array() += 1e-9;
    const Eigen::MatrixXd root = covariance.llt().matrixL();
    CounterRandom random(5, 0);
    double sum = 0, sum_of_squares = 0;
    for (int draw = 0; draw < kDraws; ++draw) {
      Eigen::VectorXd white(kParts);
      for (double& w : white) w = random.Normal();
      const Eigen::VectorXd field = root * white;
      const double variance = (field.array() - field.mean()).square().mean();
      sum += variance;
      sum_of_squares += variance * variance;
    }
    const double mean = sum / kDraws;
    const double deviation = std::sqrt(sum_of_squares / kDraws - mean * mean);
    // Parts have none within.
    EXPECT_NEAR(mean, texture.VarianceAlong(kLength_m) - texture.VarianceAlong(kLength_m / kParts),
                0.02 * mean)
        << static_cast<int>(law);
    EXPECT_NEAR(deviation, texture.DeviationOfVarianceAlong(kLength_m), 0.03 * deviation)
        << static_cast<int>(law);
    EXPECT_GT(deviation, 0.3 * mean) << static_cast<int>(law);
  }
}

// The law against the reflectances that are rendered, of many places of the plate.
TEST(TextureLaw, IsThatOfTheTextureThatIsRendered) {
  constexpr double kBlock_m = 9e-3;
  constexpr int kBlocks = 4, kPoints = 60, kPlaces = 1000;
  const std::vector<double> parameters = {0.2, 3.5e-3};
  const Effect& effect = *FindEffect("surface.albedo_texture");
  double square = 0, neighbours = 0, within = 0;
  for (int place = 0; place < kPlaces; ++place) {
    FrameSetup frame = ThinLine();
    frame.seeds.speckle = 100 + place;
    PlateScene scene;
    scene.brdf_per_sr = [](double, double) { return 1.0; };
    effect.OnPlate(scene, frame, parameters);
    double before = 0;
    for (int block = 0; block < kBlocks; ++block) {
      double sum = 0, sum_of_squares = 0;
      for (int i = 0; i < kPoints; ++i) {
        const double deviation = scene.brdf_per_sr(kBlock_m * (block + (i + 0.5) / kPoints), 0) - 1;
        sum += deviation / kPoints;
        sum_of_squares += deviation * deviation / kPoints;
      }
      square += sum * sum / (kBlocks * kPlaces);
      within += (sum_of_squares - sum * sum) / (kBlocks * kPlaces);
      if (block > 0) neighbours += sum * before / ((kBlocks - 1) * kPlaces);
      before = sum;
    }
  }
  const TextureLaw law(effect.description().random_law, ThinLine(), parameters);
  EXPECT_NEAR(square, law.Covariance(kBlock_m, 0), 0.08 * square);
  EXPECT_NEAR(within, law.VarianceAlong(kBlock_m), 0.08 * within);
  EXPECT_NEAR(neighbours, law.Covariance(kBlock_m, kBlock_m), 0.05 * square);
}

}  // namespace
}  // namespace sightline
