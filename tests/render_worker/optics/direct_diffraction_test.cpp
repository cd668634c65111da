// SPDX-License-Identifier: Apache-2.0
// The Fourier path against a direct sum: every scatterer's wave through every sample of the pupil
// to every point of the pixels, in double precision and without any fast transform.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <complex>
#include <numbers>
#include <vector>

#include "core/random/counter_random.h"
#include "direct_sum.h"
#include "render_worker/optics/image_optics.h"
#include "render_worker/optics/laser_imaging.h"
#include "test_optics.h"

namespace sightline {
namespace {

using namespace optics_test;
using std::numbers::pi;

// A few pixels of light in two or more depths; returns the largest error over the brightest pixel.
double LargestError(OpticsModel optics, int sub_pixels, const std::vector<double>& depths) {
  IdealImage image = EvenImage(5, 4, sub_pixels, 1);
  SubPixelGrid& grid = image.grid;
  if (depths.size() == 1) {
    image.constant_depth_m = depths[0];
  } else {
    image.depth_m = Image<float>(grid.columns(), grid.rows());
    for (int i = 0; i < grid.rows(); ++i) {
      for (int j = 0; j < grid.columns(); ++j) {
        image.depth_m.At(i, j) = static_cast<float>(depths[(i + j / 3) % depths.size()]);
      }
    }
  }
  for (int i = 0; i < grid.rows(); ++i) {
    for (int j = 0; j < grid.columns(); ++j) {
      image.laser_irradiance_w_m2.At(i, j) = 0.2F + 0.1F * static_cast<float>((3 * i + 5 * j) % 7);
    }
  }
  SpeckleModel speckle;
  speckle.seed = 77;
  const Image<float> got = ApplyOptics(image, optics, speckle, 2).laser_irradiance_w_m2;

  const std::vector<LaserTransform> transforms = PlanLaserTransforms(image, optics, 1);
  EXPECT_EQ(transforms.size(), 1u);
  const uint64_t seed = DeriveSeed(speckle.seed, "speckle pattern", 0);
  std::vector<Wave> waves;
  for (int i = 0; i < grid.rows(); ++i) {
    for (int j = 0; j < grid.columns(); ++j) {
      const int column = (grid.roi.column_px - grid.margin_px) * sub_pixels + j;
      const int row = (grid.roi.row_px - grid.margin_px) * sub_pixels + i;
      const auto g = CounterRandom(seed, static_cast<uint64_t>(static_cast<uint32_t>(row)) << 32 |
                                             static_cast<uint32_t>(column))
                         .NormalPair();
      const double depth = image.depth_m.empty() ? image.constant_depth_m : image.depth_m.At(i, j);
      waves.push_back(
          {grid.U(j), grid.V(i),
           std::sqrt(image.laser_irradiance_w_m2.At(i, j) / 2.0) * std::complex<double>(g[0], g[1]),
           optics.curvature(depth, 0, 0)});
    }
  }
  const double columns = transforms[0].columns_px, rows = transforms[0].rows_px;
  DirectSum direct(waves, optics, columns * kPitch_m, rows * kPitch_m,
                   columns * rows * sub_pixels * sub_pixels);
  double largest = 0, error = 0;
  for (int i = 0; i < grid.roi.rows_px; ++i) {
    for (int j = 0; j < grid.roi.columns_px; ++j) {
      const double expected = direct.PixelMean((grid.roi.column_px + j) * kPitch_m,
                                               (grid.roi.row_px + i) * kPitch_m, kPitch_m);
      largest = std::max(largest, expected);
      error = std::max(error, std::abs(expected - got.At(i, j)));
    }
  }
  EXPECT_GT(largest, 0.1);
  return error / largest;
}

TEST(DirectDiffraction, FocusedEvenSubPixels) {
  EXPECT_LT(LargestError(ClearLens(0.45), 2, {kFocus_m}), 1e-4);
}

TEST(DirectDiffraction, DefocusedOddSubPixels) {
  EXPECT_LT(LargestError(ClearLens(0.7), 3, {0.29}), 1e-4);
}

TEST(DirectDiffraction, AberratedPolygonWithObstruction) {
  OpticsModel optics = ClearLens(0.45);
  Pupil pupil = optics.pupil(0, 0);
  pupil.radius_m *= 0.9;
  pupil.blades = 7;
  pupil.obstruction_radius_m = 0.3 * pupil.radius_m;
  pupil.zernike_m = {0, 0, 0, 0, 0, 1e-7, 0, 2e-7};
  pupil.seidel = {{1.5e-7, pupil.radius_m, 3, 1, 0.6}};
  const double clear = ClearFraction(pupil);
  optics.pupil = [pupil](double, double) { return pupil; };
  // The direct sum does not know of lost light: the ideal image is made for this pupil's light.
  optics.reference_pupil_radius_m = pupil.radius_m * std::sqrt(clear);
  EXPECT_LT(LargestError(optics, 2, {0.3}), 1e-4);
}

TEST(DirectDiffraction, DepthLayersAddAsFields) {
  // Several waves of defocus between the depths, which are the centres of layers of their own, with
  // empty ones between.
  const OpticsModel optics = ClearLens(0.45);
  const double radius = PupilRadius(0.45);
  const double step = kWavelength_m / (4 * radius * radius);
  const auto depth_of = [](double curvature) { return 1 / (1 / kFocus_m - curvature); };
  EXPECT_LT(LargestError(optics, 2, {depth_of(0), depth_of(8 * step), depth_of(16 * step)}), 1e-4);
}

TEST(DirectDiffraction, LayersAreFineEnoughBetweenTheirCentres) {
  const OpticsModel optics = ClearLens(0.45);
  const double radius = PupilRadius(0.45);
  const double step = kWavelength_m / (4 * radius * radius);
  const auto depth_of = [](double curvature) { return 1 / (1 / kFocus_m - curvature); };
  const double error = LargestError(
      optics, 2, {depth_of(0), depth_of(3.5 * step), depth_of(7.45 * step), depth_of(11 * step)});
  // A wave half a layer off is wrong by pi/8 at the rim, pi/8/sqrt(12) rms over the pupil about its
  // mean; irradiance by twice that share of the field, and no wave here is worse.
  EXPECT_LT(error, 2 * pi / 8 / std::sqrt(12.0));
  EXPECT_GT(error, 1e-4);
}

}  // namespace
}  // namespace sightline
