// SPDX-License-Identifier: Apache-2.0
#include "render_worker/material/fresnel.h"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>

namespace sightline {
namespace {

// Directly in complex numbers: r_s = (cos - m cos_t)/(cos + m cos_t), r_p likewise.
double ComplexFresnel(double n, double k, double cosine) {
  const std::complex<double> m(n, k);
  const std::complex<double> sine_t = std::sqrt(1 - cosine * cosine) / m;
  const std::complex<double> cosine_t = std::sqrt(1.0 - sine_t * sine_t);
  const std::complex<double> s = (cosine - m * cosine_t) / (cosine + m * cosine_t);
  const std::complex<double> p = (m * cosine - cosine_t) / (m * cosine + cosine_t);
  return 0.5 * (std::norm(s) + std::norm(p));
}

TEST(Fresnel, NormalIncidence) {
  for (const auto& [n, k] : {std::pair{1.4F, 7.5F}, {2.9F, 3.1F}, {0.16F, 4.0F}, {1.5F, 0.0F}}) {
    const double expected = ((n - 1.0) * (n - 1.0) + k * k) / ((n + 1.0) * (n + 1.0) + k * k);
    EXPECT_NEAR(UnpolarisedFresnel(n, k, 1), expected, 1e-6);
  }
}

TEST(Fresnel, AgreesWithComplexFormulaAtAllAngles) {
  for (const auto& [n, k] : {std::pair{1.4F, 7.5F}, {2.9F, 3.1F}, {0.16F, 4.0F}, {1.5F, 0.0F}}) {
    for (int i = 0; i <= 100; ++i) {
      const float cosine = static_cast<float>(i) / 100;
      EXPECT_NEAR(UnpolarisedFresnel(n, k, cosine), ComplexFresnel(n, k, cosine), 2e-6);
    }
  }
}

// k = 0 at Brewster's angle: the parallel part vanishes, the rest is ((n^2-1)/(n^2+1))^2.
TEST(Fresnel, DielectricAtBrewsterAngle) {
  const float n = 1.5F;
  const float cosine = std::cos(std::atan(n));
  const double perpendicular = std::pow((n * n - 1.0) / (n * n + 1.0), 2);
  EXPECT_NEAR(UnpolarisedFresnel(n, 0, cosine), 0.5 * perpendicular, 1e-6);
}

TEST(Fresnel, GrazingReflectsEverything) {
  EXPECT_NEAR(UnpolarisedFresnel(1.4F, 7.5F, 0), 1, 1e-6);
  EXPECT_NEAR(SchlickFresnel(0.04F, 0), 1, 1e-6);
  EXPECT_EQ(SchlickFresnel(0.6F, 1), 0.6F);
}

}  // namespace
}  // namespace sightline
