// SPDX-License-Identifier: Apache-2.0
#include "render_worker/speckle/speckle_statistics.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <numeric>
#include <utility>
#include <vector>

namespace sightline {
namespace {

constexpr double kWavelength_m = 661e-9, kDistance_m = 0.0168, kPitch_m = 3.45e-6;

LineSpeckle GaussianLine(double radius_m, double sigma_m, double blur_m) {
  Pupil pupil;
  pupil.radius_m = radius_m;
  std::vector<double> ideal;
  for (int i = -2048; i < 2048; ++i) {
    const double v = i * kPitch_m / 4 / sigma_m;
    ideal.push_back(std::exp(-0.5 * v * v));
  }
  return {pupil,    kWavelength_m, kDistance_m,     blur_m / radius_m,
          kPitch_m, ideal,         -512 * kPitch_m, kPitch_m / 4};
}

double Radius(double airy_px) { return kWavelength_m * kDistance_m / (2 * airy_px * kPitch_m); }

// A wide line in focus lights the pupil evenly: |mu|^2 of the Airy pattern, averaged over the
// distances of two pixels (Goodman, Speckle Phenomena in Optics, 4.4).
TEST(LineSpeckle, WideLineInFocusIsThatOfTheAiryPattern) {
  for (const double airy_px : {0.56, 1.6, 3.2}) {
    const LineSpeckle line = GaussianLine(Radius(airy_px), 60 * kPitch_m, 0);
    for (int lag = 0; lag <= 2; ++lag) {
      constexpr int kSteps = 200;
      double sum = 0;
      for (int i = 0; i < kSteps; ++i) {
        for (int j = 0; j < kSteps; ++j) {
          const double dx = (i + 0.5) / kSteps * 2 - 1, dy = (j + 0.5) / kSteps * 2 - 1;
          const double x = std::numbers::pi * std::hypot(dx, dy + lag) / airy_px;
          const double mu = 2 * std::cyl_bessel_j(1.0, x) / x;
          sum += (1 - std::abs(dx)) * (1 - std::abs(dy)) * mu * mu;
        }
      }
      const double exact = sum * 4 / (kSteps * kSteps);
      // Sampling of the pupil; the line is so wide that its own width adds 5e-4 at most.
      EXPECT_NEAR(line.At(4).At(0, lag), exact, 0.006) << airy_px << " " << lag;
      EXPECT_NEAR(line.At(4).At(lag, 0), exact, 0.006) << airy_px << " " << lag;
    }
  }
}

// A line far finer than the Airy pattern is coherent across, so speckle varies along it only and
// pixels above each other agree.
TEST(LineSpeckle, FineLineIsCoherentAcross) {
  const LineSpeckle line = GaussianLine(Radius(4), 0.1 * kPitch_m, 0);
  EXPECT_GT(line.At(4).At(1, 0) / line.At(4).At(0, 0), 0.99);
  EXPECT_LT(line.At(4).At(0, 3) / line.At(4).At(0, 0), 0.75);
}

// Defocus: a place sees a part of the pupil only, so speckle grows across the line.
TEST(LineSpeckle, DefocusStretchesAcross) {
  const LineSpeckle sharp = GaussianLine(Radius(0.56), 3 * kPitch_m, 0);
  const LineSpeckle blurred = GaussianLine(Radius(0.56), 3 * kPitch_m, 13 * kPitch_m);
  EXPECT_GT(blurred.At(4).At(1, 0), 2 * sharp.At(4).At(1, 0));
  EXPECT_GT(blurred.At(4).At(0, 0), 1.3 * sharp.At(4).At(0, 0));
}

// A bug found: across the line speckle counted as independent two pixels on, as along it, and a
// radius a little larger made it so one pixel on: a blade was seen where there was none.
TEST(LineSpeckle, ReachesAcrossAsFarAsDefocusStretchesIt) {
  constexpr double kAiry_px = 0.28, kBlur_m = 10 * kPitch_m;
  const auto two_rows_on = [&](double airy_px) {
    const LineSpeckle line = GaussianLine(Radius(airy_px), kPitch_m, kBlur_m);
    return line.At(4).At(2, 0) / line.At(4).At(0, 0);
  };
  EXPECT_GT(two_rows_on(kAiry_px), 0.01);
  for (const double factor : {0.92, 0.96, 1.04, 1.08}) {
    // The same blur by another pupil stretches about alike; the cut made it 0.
    EXPECT_NEAR(two_rows_on(factor * kAiry_px) / two_rows_on(kAiry_px), 1, 0.6) << factor;
  }
}

// A bug found: means of a dozen intervals vary less than what lies in them, and speckle's contrast
// was 4 % too low.
TEST(SpecklePixelCovariance, SharedByNeighboursIsTheCorrelationOfTheirShares) {
  // Independent pixels of contrast 1, of which each keeps 60 % and gives 10 % to four neighbours.
  const SpecklePixelCovariance independent(3, 0, 0, std::vector<double>(16, 1.0));
  Image<double> shares(3, 3, 0.0);
  shares.At(1, 1) = 0.6;
  for (const auto& [i, j] : {std::pair{0, 1}, {1, 0}, {1, 2}, {2, 1}}) shares.At(i, j) = 0.1;
  const SpecklePixelCovariance shared = independent.Shared(shares);
  EXPECT_NEAR(shared.At(0, 0), 0.36 + 4 * 0.01, 1e-12);
  EXPECT_NEAR(shared.At(0, 1), 2 * 0.6 * 0.1, 1e-12);
  EXPECT_NEAR(shared.At(1, 1), 2 * 0.1 * 0.1, 1e-12);
  EXPECT_NEAR(shared.At(2, 0), 0.1 * 0.1, 1e-12);
  EXPECT_NEAR(shared.At(3, 0), 0, 1e-12);
}

// Aberrations change the image, not the statistics of the speckle of an even object; a blade does.
TEST(LineSpeckle, ShapeCountsAndWavefrontDoesNot) {
  Pupil pupil;
  pupil.radius_m = Radius(1.5);
  const auto contrast_squared = [](const Pupil& shape) {
    const std::vector<double> ideal(512, 1.0);
    return LineSpeckle(shape, kWavelength_m, kDistance_m, 0, kPitch_m, ideal, -64 * kPitch_m,
                       kPitch_m / 4)
        .At(4)
        .At(0, 0);
  };
  const double circle = contrast_squared(pupil);
  pupil.zernike_m = {0, 0, 0, 0, 0, 1e-7};
  EXPECT_EQ(contrast_squared(pupil), circle);
  pupil.obstruction_radius_m = 0.5 * pupil.radius_m;
  EXPECT_NE(contrast_squared(pupil), circle);
}

}  // namespace
}  // namespace sightline
