// SPDX-License-Identifier: Apache-2.0
// Levels of integrated speckle stand for what pixels of simulated fields show.
#include "render_worker/speckle/integrated_speckle.h"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "core/random/counter_random.h"

namespace sightline {
namespace {

TEST(SpeckleLevels, MeanAndVarianceOfFewAsOfMany) {
  for (const int count : {4, 12, 400}) {
    for (const double contrast_squared : {0.01, 0.05, 0.3, 0.9, 1.0}) {
      double mean = 0, square = 0;
      for (const double level : SpeckleLevels(contrast_squared, count)) {
        EXPECT_GE(level, 0);
        mean += level / count;
        square += level * level / count;
      }
      EXPECT_NEAR(mean, 1, 1e-9);
      EXPECT_NEAR(square - 1, contrast_squared, 1e-3 * contrast_squared) << count;
    }
  }
}

TEST(SpeckleLevels, WithoutContrastAllAreOne) {
  for (const double level : SpeckleLevels(0, 12)) EXPECT_EQ(level, 1);
}

TEST(SpeckleLevels, OneLawPassesIntoTheOther) {
  for (const double contrast_squared : {0.05, 0.1}) {
    const std::vector<double> below = SpeckleLevels(contrast_squared - 1e-6, 12);
    const std::vector<double> above = SpeckleLevels(contrast_squared + 1e-6, 12);
    for (size_t i = 0; i < below.size(); ++i) EXPECT_NEAR(below[i], above[i], 1e-4);
  }
}

// Irradiances of pixels under a circular pupil, whose speckle is `width` pixels wide: exponential
// ones, weighted with the eigenvalues of the coherence J_1(x)/x on a grid over the pixel.
std::vector<double> SimulatedPixels(double width, int count) {
  constexpr int kSide = 10;
  Eigen::MatrixXd coherence(kSide * kSide, kSide * kSide);
  for (int a = 0; a < kSide * kSide; ++a) {
    for (int b = 0; b < kSide * kSide; ++b) {
      const double x = std::numbers::pi * std::hypot(a / kSide - b / kSide, a % kSide - b % kSide) /
                       (kSide * width);
      coherence(a, b) = (x == 0 ? 1 : 2 * std::cyl_bessel_j(1, x) / x) / (kSide * kSide);
    }
  }
  const Eigen::VectorXd weights =
      Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(coherence).eigenvalues();
  CounterRandom random(7, 0);
  std::vector<double> pixels(count, 0);
  for (double& pixel : pixels) {
    for (const double weight : weights) {
      if (weight > 1e-4) pixel -= weight * std::log(1 - random.Uniform());
    }
  }
  return pixels;
}

// A bug found: saturated rows of recordings without any effect were 4 % brighter than expected,
// which looked like a loss of contrast. Half was the Gamma law, half the way levels were stretched.
TEST(SpeckleLevels, CutOffTheyKeepTheMeanOfSimulatedPixels) {
  for (const double width : {0.5, 0.8, 1.2, 2.0}) {
    const std::vector<double> pixels = SimulatedPixels(width, 100000);
    double mean = 0, square = 0;
    for (const double pixel : pixels) {
      mean += pixel / static_cast<double>(pixels.size());
      square += pixel * pixel / static_cast<double>(pixels.size());
    }
    const std::vector<double> levels = SpeckleLevels(square / (mean * mean) - 1, 12);
    for (const double top : {0.3, 0.5, 0.7, 1.0, 1.5, 2.5}) {
      double seen = 0, expected = 0;
      for (const double pixel : pixels) seen += std::min(pixel / mean, top) / pixels.size();
      for (const double level : levels) expected += std::min(level, top) / levels.size();
      EXPECT_NEAR(expected / seen, 1, top > 1 ? 0.03 : 0.01) << width << " " << top;
    }
  }
}

}  // namespace
}  // namespace sightline
