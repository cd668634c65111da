// SPDX-License-Identifier: Apache-2.0
#include "render_worker/light_transport/feature_filter.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "core/random/counter_random.h"

namespace sightline {
namespace {

struct FilterInput {
  PixelValues values{40, 30, 2, std::vector<float>(40 * 30 * 2, 0)};
  std::vector<PixelFeatures> features{40 * 30};
  std::vector<int> samples = std::vector<int>(40 * 30, 16);

  FilterInput() {
    for (int i = 0; i < 30; ++i) {
      for (int j = 0; j < 40; ++j) {
        PixelFeatures& f = features[i * 40 + j];
        f.material = 0;
        f.footprint_m = 1e-3F;
        f.normal = Eigen::Vector3f::UnitZ();
        f.position_m = {1e-3F * static_cast<float>(j), 1e-3F * static_cast<float>(i), 0};
      }
    }
  }
  PixelValues Filtered(int radius) const { return Both(radius)[0]; }
  std::array<PixelValues, 2> Both(int radius) const {
    std::array<PixelValues, 2> out = {values, values};
    FeatureFilter(values, features, samples, radius).Rows(0, 30, out[0], out[1]);
    return out;
  }
};

TEST(FeatureFilter, KeepsLinearLightAlsoAtTheImageBorder) {
  FilterInput input;
  for (int p = 0; p < 40 * 30; ++p) {
    const int row = p / 40, column = p % 40;
    input.values.At(p)[0] = 3 + 0.1F * static_cast<float>(column) - 0.2F * static_cast<float>(row);
  }
  const PixelValues out = input.Filtered(8);
  // The ridge of 1e-3 on slopes of windows several pixels wide: below 1e-3 of the slope's effect.
  for (int p = 0; p < 40 * 30; ++p) {
    EXPECT_NEAR(out.At(p)[0], input.values.At(p)[0], 1e-3);
  }
}

TEST(FeatureFilter, ParaboloidKeepsQuadraticLightWhereThePlaneCannot) {
  FilterInput input;
  for (int p = 0; p < 40 * 30; ++p) {
    const int row = p / 40, column = p % 40;
    const auto x = static_cast<float>(column) / 40, y = static_cast<float>(row) / 40;
    input.values.At(p)[1] = 2 + x - y + 3 * x * x - 2 * x * y + y * y;
  }
  const auto out = input.Both(8);
  double plane = 0;
  for (int p = 0; p < 40 * 30; ++p) {
    // Rounding: a few hundred terms of about 2, float.
    EXPECT_NEAR(out[1].At(p)[1], input.values.At(p)[1], 1e-4);
    plane = std::max<double>(plane, std::abs(out[0].At(p)[1] - input.values.At(p)[1]));
  }
  EXPECT_GT(plane, 0.01);
}

TEST(FeatureFilter, AveragesNoiseOnOneSurfaceAndStopsAtEdges) {
  FilterInput input;
  for (int i = 0; i < 30; ++i) {
    for (int j = 0; j < 40; ++j) {
      const int p = i * 40 + j;
      CounterRandom random(1, p);
      input.values.At(p)[0] = static_cast<float>((j < 20 ? 1 : 5) + 0.1 * random.Normal());
      if (j >= 20) input.features[p].normal = Eigen::Vector3f::UnitX();
    }
  }
  const PixelValues out = input.Filtered(8);
  double square = 0;
  for (int p = 0; p < 40 * 30; ++p) {
    const double error = out.At(p)[0] - (p % 40 < 20 ? 1 : 5);
    // A plane fitted to a quarter window has a standard deviation of about 0.04 in its corner.
    EXPECT_LT(std::abs(error), 0.2);
    square += error * error / (40 * 30);
  }
  // At least 60 pixels weigh in everywhere but in the corners.
  EXPECT_LT(std::sqrt(square), 0.1 / 4);
}

TEST(FeatureFilter, NearbyReflectorsNarrowTheWindow) {
  FilterInput input;
  for (int p = 0; p < 40 * 30; ++p) input.values.At(p)[0] = p % 2 == 0 ? 1.0F : 0.0F;
  for (auto& f : input.features) f.inverse_distance_1_m = 1 / 1e-3F;  // as near as a pixel is wide
  const PixelValues out = input.Filtered(8);
  EXPECT_EQ(out.values, input.values.values);
}

TEST(FeatureFilter, PixelsOfSeveralSurfacesStay) {
  FilterInput input;
  for (int p = 0; p < 40 * 30; ++p) input.values.At(p)[0] = static_cast<float>(p % 7);
  for (auto& f : input.features) f.uniform = false;
  EXPECT_EQ(input.Filtered(8).values, input.values.values);
}

}  // namespace
}  // namespace sightline
