// SPDX-License-Identifier: Apache-2.0
#include "render_worker/optics/complex_product.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>

namespace sightline {
namespace {

TEST(PhasorOfTurns, IsTheExponentialOfTheAngle) {
  double largest = 0;
  for (int i = -40000; i <= 40000; ++i) {
    const double turns = i * 0.001237;
    const std::complex<double> exact = std::polar(1.0, 2 * std::numbers::pi * turns);
    largest = std::max(largest, std::abs(exact - std::complex<double>(PhasorOfTurns(turns))));
  }
  EXPECT_LT(largest, 1e-6);
  // Ends of the interval that angles are brought to.
  EXPECT_NEAR(PhasorOfTurns(0.5).real(), -1, 1e-6);
  EXPECT_NEAR(PhasorOfTurns(-0.5).real(), -1, 1e-6);
  EXPECT_NEAR(PhasorOfTurns(1e8 + 0.25).imag(), 1, 1e-6);
}

}  // namespace
}  // namespace sightline
