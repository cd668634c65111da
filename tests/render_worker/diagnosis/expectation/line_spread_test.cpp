// SPDX-License-Identifier: Apache-2.0
// The line's transfer function against closed forms and a direct sum over the pupil.
#include "render_worker/diagnosis/expectation/line_spread.h"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <numbers>
#include <vector>

namespace sightline {
namespace {

constexpr double kWavelength_m = 661e-9;
constexpr double kImageDistance_m = 0.0168;
constexpr int kStripes = 12;

Pupil Circle(double f_number) {
  Pupil pupil;
  pupil.radius_m = 0.016 / f_number / 2;
  return pupil;
}

// So that the last frequency is a little below the cut-off.
double StepPerM(const Pupil& pupil) {
  return 2 * pupil.radius_m / (kWavelength_m * kImageDistance_m) / kStripes;
}

std::vector<std::complex<double>> Transfer(const Pupil& pupil, double curvature_per_m) {
  return LineTransfer(pupil, kWavelength_m, kImageDistance_m, curvature_per_m, StepPerM(pupil),
                      kStripes);
}

// Autocorrelation of the generalised pupil along v, sampled finely.
std::complex<double> DirectSum(const Pupil& pupil, double curvature_per_m, double shift_m) {
  constexpr int kSamples = 500;
  const double step_m = 2 * pupil.radius_m / kSamples;
  const auto amplitude = [&](double x, double y) -> std::complex<double> {
    if (pupil.Transmission(x, y) == 0) return 0;
    const double path_m = pupil.WavefrontError(x, y) - 0.5 * curvature_per_m * (x * x + y * y);
    return std::polar(1.0, 2 * std::numbers::pi * path_m / kWavelength_m);
  };
  std::complex<double> sum = 0;
  double clear = 0;
  for (int i = 0; i < kSamples; ++i) {
    const double x = (i + 0.5) * step_m - pupil.radius_m;
    for (int j = 0; j < kSamples; ++j) {
      const double y = (j + 0.5) * step_m - pupil.radius_m;
      clear += pupil.Transmission(x, y);
      sum += amplitude(x, y) * std::conj(amplitude(x, y + shift_m));
    }
  }
  return sum / clear;
}

void ExpectAsSummed(const Pupil& pupil, double curvature_per_m) {
  const std::vector<std::complex<double>> transfer = Transfer(pupil, curvature_per_m);
  for (int k = 0; k < kStripes; ++k) {
    const double shift_m = 2 * pupil.radius_m * k / kStripes;
    const std::complex<double> sum = DirectSum(pupil, curvature_per_m, shift_m);
    // The orientation of the image is checked elsewhere.
    EXPECT_NEAR(transfer[k].real(), sum.real(), 4e-3) << k;
    EXPECT_NEAR(std::abs(transfer[k].imag()), std::abs(sum.imag()), 4e-3) << k;
  }
}

TEST(LineTransfer, OfAPerfectLensInFocusIsItsClosedForm) {
  const Pupil pupil = Circle(4);
  const std::vector<std::complex<double>> transfer = Transfer(pupil, 0);
  for (int k = 0; k < kStripes; ++k) {
    const double s = static_cast<double>(k) / kStripes;
    const double expected = 2 / std::numbers::pi * (std::acos(s) - s * std::sqrt(1 - s * s));
    EXPECT_NEAR(transfer[k].real(), expected, 1e-5) << k;
    EXPECT_EQ(transfer[k].imag(), 0) << k;
  }
}

TEST(LineTransfer, OutOfFocusIsTheDirectSum) {
  for (const double f_number : {2.0, 8.0}) {
    const Pupil pupil = Circle(f_number);
    for (const double waves : {0.4, 3.0, -9.0, 29.0, 35.0}) {
      SCOPED_TRACE(waves);
      ExpectAsSummed(pupil, 2 * waves * kWavelength_m / (pupil.radius_m * pupil.radius_m));
    }
  }
}

TEST(LineTransfer, WithAberrationsAndAClippedPupilIsTheDirectSum) {
  Pupil pupil = Circle(2.8);
  const double waves_in_m = kWavelength_m;
  pupil.seidel.push_back({1.5 * waves_in_m, pupil.radius_m, 4, 0, 0});
  pupil.seidel.push_back({0.8 * waves_in_m, pupil.radius_m, 3, 1, std::numbers::pi / 2});
  const double curvature_per_m = 2 * kWavelength_m / (pupil.radius_m * pupil.radius_m);
  ExpectAsSummed(pupil, curvature_per_m);
  pupil.clips.push_back({0.3 * pupil.radius_m, 0.2 * pupil.radius_m, pupil.radius_m});
  ExpectAsSummed(pupil, curvature_per_m);
  pupil.blades = 6;
  ExpectAsSummed(pupil, curvature_per_m);
}

}  // namespace
}  // namespace sightline
