// SPDX-License-Identifier: Apache-2.0
// Statistics of fully developed speckle against closed forms. Bounds are four standard errors of
// the mean over independent realisations unless said otherwise: a false alarm once in 16 000.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "render_worker/optics/image_optics.h"
#include "test_optics.h"

namespace sightline {
namespace {

using namespace optics_test;

struct MeanEstimate {
  double mean, standard_error;
};

MeanEstimate EstimateOf(const std::vector<double>& values) {
  double sum = 0, squares = 0;
  for (const double value : values) sum += value;
  const double n = static_cast<double>(values.size());
  for (const double value : values) squares += (value - sum / n) * (value - sum / n);
  return {sum / n, std::sqrt(squares / (n - 1) / n)};
}

Image<float> Speckle(double cut_off, int size_px, int sub_pixels, uint64_t seed,
                     const std::vector<double>& weights = {1}) {
  // Even light: what comes from beyond the margin looks like what is inside, so a short one will
  // do.
  const IdealImage image = EvenImage(size_px, size_px, sub_pixels, 8);
  SpeckleModel speckle;
  speckle.seed = seed;
  speckle.pattern_weights = weights;
  return ApplyOptics(image, ClearLens(cut_off), speckle, 2).laser_irradiance_w_m2;
}

// Squared contrast over known mean 1: unbiased whatever the correlation.
double SquaredContrast(const Image<float>& image) {
  double sum = 0;
  for (const float value : image.values) sum += (value - 1.0) * (value - 1.0);
  return sum / static_cast<double>(image.values.size());
}

MeanEstimate SquaredContrastOf(double cut_off, int size_px, int sub_pixels,
                               const std::vector<double>& weights, int realisations) {
  std::vector<double> values;
  for (int i = 0; i < realisations; ++i) {
    values.push_back(SquaredContrast(Speckle(cut_off, size_px, sub_pixels, 100 + i, weights)));
  }
  return EstimateOf(values);
}

TEST(Speckle, ContrastIsOneWherePixelsAreFine) {
  // Six pixels from a speckle's middle to its first zero: pixels take 3 % of the squared contrast.
  const double expected = PixelCorrelation(0.1, 0, 0);
  EXPECT_GT(expected, 0.96);
  const MeanEstimate got = SquaredContrastOf(0.1, 256, 2, {1}, 16);
  EXPECT_NEAR(got.mean, expected, 4 * got.standard_error);
  EXPECT_LT(got.standard_error, 0.05);
}

TEST(Speckle, TwoIndependentPatternsHaveContrastOneOverRootTwo) {
  const double expected = PixelCorrelation(0.1, 0, 0) / 2;
  const MeanEstimate got = SquaredContrastOf(0.1, 256, 2, {0.5, 0.5}, 16);
  EXPECT_NEAR(got.mean, expected, 4 * got.standard_error);
  EXPECT_LT(got.standard_error, 0.02);
}

TEST(Speckle, ContrastAfterPixelsFollowsTheClosedForm) {
  // From coarse to fine speckle, with odd and even sub-pixels, at the least the rule allows.
  for (const double cut_off : {0.35, 0.7, 1.2}) {
    const int sub_pixels = std::max(2, static_cast<int>(std::ceil(4 * cut_off)));
    const double expected = PixelCorrelation(cut_off, 0, 0);
    const MeanEstimate got = SquaredContrastOf(cut_off, 96, sub_pixels, {1}, 12);
    EXPECT_NEAR(got.mean, expected, 4 * got.standard_error) << cut_off;
    EXPECT_LT(got.standard_error, 0.01 * expected + 0.01);
  }
}

TEST(Speckle, IntensityIsNegativeExponential) {
  // Kolmogorov-Smirnov at 1 % on samples further apart than the speckle.
  std::vector<double> samples;
  for (int seed = 0; seed < 8; ++seed) {
    const Image<float> image = Speckle(0.1, 320, 2, 700 + seed);
    for (int i = 0; i < 320; i += 16) {
      for (int j = 0; j < 320; j += 16) samples.push_back(image.At(i, j));
    }
  }
  std::sort(samples.begin(), samples.end());
  double distance = 0;
  const double n = static_cast<double>(samples.size());
  for (size_t i = 0; i < samples.size(); ++i) {
    const double law = 1 - std::exp(-samples[i]);
    const double index = static_cast<double>(i);
    distance = std::max({distance, law - index / n, (index + 1) / n - law});
  }
  EXPECT_LT(distance, 1.63 / std::sqrt(n));
}

TEST(Speckle, AutocorrelationIsThatOfThePupil) {
  const double cut_off = 0.2;
  const int size = 160;
  const int realisations = 24;
  constexpr int kLags = 6;
  std::vector<std::vector<double>> along(kLags), down(kLags), diagonal(kLags);
  for (int r = 0; r < realisations; ++r) {
    const Image<float> image = Speckle(cut_off, size, 2, 300 + r);
    for (int lag = 0; lag < kLags; ++lag) {
      double sum_along = 0, sum_down = 0, sum_diagonal = 0;
      for (int i = 0; i < size - lag; ++i) {
        for (int j = 0; j < size - lag; ++j) {
          const double here = image.At(i, j) - 1.0;
          sum_along += here * (image.At(i, j + lag) - 1.0);
          sum_down += here * (image.At(i + lag, j) - 1.0);
          sum_diagonal += here * (image.At(i + lag, j + lag) - 1.0);
        }
      }
      const double n = static_cast<double>(size - lag) * (size - lag);
      along[lag].push_back(sum_along / n);
      down[lag].push_back(sum_down / n);
      diagonal[lag].push_back(sum_diagonal / n);
    }
  }
  for (int lag = 0; lag < kLags; ++lag) {
    const double straight = PixelCorrelation(cut_off, lag, 0);
    const MeanEstimate a = EstimateOf(along[lag]);
    const MeanEstimate d = EstimateOf(down[lag]);
    const MeanEstimate s = EstimateOf(diagonal[lag]);
    EXPECT_NEAR(a.mean, straight, 4 * a.standard_error) << lag;
    EXPECT_NEAR(d.mean, straight, 4 * d.standard_error) << lag;
    EXPECT_NEAR(s.mean, PixelCorrelation(cut_off, lag, lag), 4 * s.standard_error) << lag;
    EXPECT_LT(a.standard_error, 0.02);
  }
}

TEST(Speckle, ShiftedScatterersDecorrelateLikeThePupil) {
  // A shift of a whole and of a broken number of sub-pixels.
  const double cut_off = 0.35;
  const OpticsModel optics = ClearLens(cut_off);
  const IdealImage image = EvenImage(128, 128, 2, 8);
  for (const double shift_px : {0.3, 0.65, 1.0}) {
    std::vector<double> correlations;
    for (int r = 0; r < 16; ++r) {
      SpeckleModel speckle;
      speckle.seed = 900 + r;
      const Image<float> still = ApplyOptics(image, optics, speckle, 2).laser_irradiance_w_m2;
      speckle.shifts = {{shift_px * kPitch_m, 0}};
      const Image<float> moved = ApplyOptics(image, optics, speckle, 2).laser_irradiance_w_m2;
      double sum = 0;
      for (size_t i = 0; i < still.values.size(); ++i) {
        sum += (still.values[i] - 1.0) * (moved.values[i] - 1.0);
      }
      correlations.push_back(sum / static_cast<double>(still.values.size()));
    }
    const MeanEstimate got = EstimateOf(correlations);
    EXPECT_NEAR(got.mean, PixelCorrelation(cut_off, shift_px, 0), 4 * got.standard_error)
        << shift_px;
    EXPECT_LT(got.standard_error, 0.03);
  }
}

TEST(Speckle, WholePixelShiftMovesThePattern) {
  const OpticsModel optics = ClearLens(0.4);
  const IdealImage image = EvenImage(96, 64, 3, 60);
  SpeckleModel speckle;
  const Image<float> still = ApplyOptics(image, optics, speckle, 2).laser_irradiance_w_m2;
  speckle.shifts = {{3 * kPitch_m, -2 * kPitch_m}};
  const Image<float> moved = ApplyOptics(image, optics, speckle, 2).laser_irradiance_w_m2;
  double squares = 0;
  int count = 0;
  for (int i = 0; i < 60; ++i) {
    for (int j = 3; j < 96; ++j) {
      const double difference = moved.At(i, j) - still.At(i + 2, j - 3);
      squares += difference * difference;
      ++count;
    }
  }
  // Scatterers on the grid's rim differ: the field loses less than 2 lambda N'/(pi^2 60 px) of its
  // energy there, 1/(2 pi^2 q_c 60), to either image.
  const double lost = 2 / (2 * 9.87 * 0.4 * 60);
  EXPECT_LT(std::sqrt(squares / count), std::sqrt(2 * lost));
  EXPECT_GT(MomentsOf(still).contrast, 0.5);
}

TEST(Speckle, MeanOfManyIsTheIncoherentImage) {
  // A defocused line, cut out at random places: mean over realisations against the optical transfer
  // function's path.
  const OpticsModel optics = ClearLens(0.6);
  IdealImage image = EvenImage(64, 48, 3, 8);
  image.constant_depth_m = 0.25;
  for (int i = 0; i < image.grid.rows(); ++i) {
    const double v = image.grid.V(i) / kPitch_m;
    for (int j = 0; j < image.grid.columns(); ++j) {
      image.laser_irradiance_w_m2.At(i, j) = static_cast<float>(std::exp(-v * v / 18));
    }
  }
  SpeckleModel off;
  off.on = false;
  const Image<float> expected = ApplyOptics(image, optics, off, 2).laser_irradiance_w_m2;
  std::vector<std::vector<double>> rows(48);
  for (int r = 0; r < 40; ++r) {
    SpeckleModel speckle;
    speckle.seed = 4000 + r;
    const Image<float> one = ApplyOptics(image, optics, speckle, 2).laser_irradiance_w_m2;
    for (int i = 0; i < 48; ++i) {
      double sum = 0;
      for (int j = 0; j < 64; ++j) sum += one.At(i, j);
      rows[i].push_back(sum / 64);
    }
  }
  for (int i = 0; i < 48; ++i) {
    double sum = 0;
    for (int j = 0; j < 64; ++j) sum += expected.At(i, j);
    const MeanEstimate got = EstimateOf(rows[i]);
    EXPECT_NEAR(got.mean, sum / 64, 4 * got.standard_error) << i;
  }
}

}  // namespace
}  // namespace sightline
