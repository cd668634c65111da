// SPDX-License-Identifier: Apache-2.0
#include "render_worker/sensor/demosaic.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/sensor/sensor.h"

namespace sightline {
namespace {

// The mosaic of a colour image whose first pixel is at (row_px, column_px).
template <typename Colour>
Image<uint16_t> Mosaic(int size, int row_px, int column_px, const Colour& colour) {
  Sensor sensor;
  sensor.colour_filter = ColourFilter::kBayerRggb;
  Image<uint16_t> raw(size, size);
  for (int i = 0; i < size; ++i) {
    for (int j = 0; j < size; ++j) {
      raw.At(i, j) = static_cast<uint16_t>(
          std::lround(colour(i, j)[sensor.ChannelAt(row_px + i, column_px + j)]));
    }
  }
  return raw;
}

TEST(Demosaic, KeepsAUniformColourWhereverTheRegionStarts) {
  const std::array<double, 3> colour = {480, 90, 30};
  for (const int row : {-3, -2, 0, 1}) {
    for (const int column : {-5, 0, 3, 4}) {
      const auto raw = Mosaic(9, row, column, [&](int, int) { return colour; });
      const auto bilinear = Demosaic(raw, row, column, DemosaicMethod::kBilinear);
      ASSERT_TRUE(bilinear.ok());
      for (int c = 0; c < 3; ++c) {
        EXPECT_EQ((*bilinear)[c], Image<float>(9, 9, static_cast<float>(colour[c])));
      }
      // Its gradient correction vanishes as well.
      const auto malvar = Demosaic(raw, row, column, DemosaicMethod::kMalvarHeCutler);
      ASSERT_TRUE(malvar.ok());
      for (int c = 0; c < 3; ++c) {
        EXPECT_EQ((*malvar)[c], Image<float>(9, 9, static_cast<float>(colour[c])));
      }
    }
  }
}

TEST(Demosaic, KeepsLinearGradients) {
  const auto colour = [](int i, int j) {
    return std::array<double, 3>{100.0 + 8 * i + 4 * j, 300.0 + 8 * i + 4 * j,
                                 200.0 + 8 * i + 4 * j};
  };
  const auto raw = Mosaic(16, 0, 0, colour);
  for (const auto method : {DemosaicMethod::kBilinear, DemosaicMethod::kMalvarHeCutler}) {
    const auto rgb = Demosaic(raw, 0, 0, method);
    ASSERT_TRUE(rgb.ok());
    for (int i = 2; i < 14; ++i) {
      for (int j = 2; j < 14; ++j) {
        for (int c = 0; c < 3; ++c) ASSERT_EQ((*rgb)[c].At(i, j), colour(i, j)[c]);
      }
    }
  }
}

// The paper's claim: on detail that all colours share it errs less.
TEST(Demosaic, GradientCorrectionErrsLessOnSharedDetail) {
  const auto colour = [](int i, int j) {
    const double detail = 200 * std::sin(0.8 * i) * std::cos(0.7 * j);
    return std::array<double, 3>{400 + detail, 500 + detail, 300 + detail};
  };
  const auto raw = Mosaic(64, 0, 0, colour);
  double error[2] = {};
  for (const int m : {0, 1}) {
    const auto rgb =
        Demosaic(raw, 0, 0, m ? DemosaicMethod::kMalvarHeCutler : DemosaicMethod::kBilinear);
    ASSERT_TRUE(rgb.ok());
    for (int i = 2; i < 62; ++i) {
      for (int j = 2; j < 62; ++j) {
        for (int c = 0; c < 3; ++c) error[m] += std::pow((*rgb)[c].At(i, j) - colour(i, j)[c], 2);
      }
    }
  }
  // 5.5 dB in peak signal to noise on the paper's pictures.
  EXPECT_LT(error[1], error[0] * std::pow(10, -0.5));
}

TEST(Demosaic, RefusesImagesTooSmall) {
  for (const auto& [columns, rows] : {std::pair(2, 8), std::pair(8, 2), std::pair(0, 0)}) {
    const auto rgb = Demosaic(Image<uint16_t>(columns, rows), 0, 0, DemosaicMethod::kBilinear);
    EXPECT_EQ(rgb.status().code(), absl::StatusCode::kInvalidArgument);
  }
}

TEST(WhiteBalance, GreyWorldMakesTheMeanGrey) {
  RgbImage image = {Image<float>(2, 1), Image<float>(2, 1), Image<float>(2, 1)};
  image[0].values = {14, 1000};
  image[1].values = {26, 1000};
  image[2].values = {42, 900};
  const auto factors = GreyWorldFactors(image, 10, 1000);
  EXPECT_DOUBLE_EQ(factors[0], 4);
  EXPECT_DOUBLE_EQ(factors[1], 1);
  EXPECT_DOUBLE_EQ(factors[2], 0.5);
  WhiteBalance(factors, 10, &image);
  for (int c = 0; c < 3; ++c) EXPECT_FLOAT_EQ(image[c].values[0], 26);
  EXPECT_EQ(GreyWorldFactors(image, 2000, 0), (std::array<double, 3>{1, 1, 1}));
}

}  // namespace
}  // namespace sightline
