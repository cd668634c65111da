// SPDX-License-Identifier: Apache-2.0
#include "render_worker/optics/pupil.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "render_worker/optics/optical_transfer.h"
#include "test_optics.h"

namespace sightline {
namespace {

using namespace optics_test;
using std::numbers::pi;

Pupil Circle(double radius_m) {
  Pupil pupil;
  pupil.radius_m = radius_m;
  return pupil;
}

TEST(Pupil, ZernikePolynomialsAreOrthonormal) {
  constexpr int kTerms = 15, kRadial = 200, kAngular = 64;
  for (int a = 1; a <= kTerms; ++a) {
    for (int b = a; b <= kTerms; ++b) {
      double sum = 0;
      for (int i = 0; i < kRadial; ++i) {
        const double rho = (i + 0.5) / kRadial;
        for (int j = 0; j < kAngular; ++j) {
          const double phi = 2 * pi * (j + 0.5) / kAngular;
          sum += ZernikeNoll(a, rho, phi) * ZernikeNoll(b, rho, phi) * 2 * rho;
        }
      }
      // Midpoint rule in rho: error about (d^2/d rho^2) / (24 kRadial^2).
      EXPECT_NEAR(sum / (kRadial * kAngular), a == b ? 1 : 0, 5e-3) << a << " " << b;
    }
  }
  EXPECT_NEAR(ZernikeNoll(4, 1, 0), std::sqrt(3.0), 1e-12);   // defocus at the rim
  EXPECT_NEAR(ZernikeNoll(11, 0, 0), std::sqrt(5.0), 1e-12);  // spherical at the centre
  EXPECT_NEAR(ZernikeNoll(2, 1, 0), 2, 1e-12);                // tilt in x
  EXPECT_NEAR(ZernikeNoll(3, 1, pi / 2), 2, 1e-12);           // tilt in y
}

TEST(Pupil, ClearFractionOfKnownShapes) {
  Pupil pupil = Circle(2e-3);
  EXPECT_EQ(ClearFraction(pupil), 1);
  pupil.obstruction_radius_m = 0.6e-3;
  EXPECT_NEAR(ClearFraction(pupil), 1 - 0.09, 1e-5);
  for (const int blades : {3, 5, 8}) {
    Pupil polygon = Circle(2e-3);
    polygon.blades = blades;
    polygon.rotation_rad = 0.2;
    EXPECT_NEAR(ClearFraction(polygon), 1, 1e-5) << blades;
  }
  // Two equal circles a radius apart: 2 acos(1/2)/pi - sqrt(3)/(2 pi).
  Pupil cut = Circle(2e-3);
  cut.clips = {{2e-3 * std::cos(0.3), 2e-3 * std::sin(0.3), 2e-3}};
  EXPECT_NEAR(ClearFraction(cut), 2.0 / 3 - std::sqrt(3.0) / (2 * pi), 1e-5);
  cut.clips = {{0.5e-3, 0, 3e-3}};
  EXPECT_EQ(ClearFraction(cut), 1);
}

TEST(Pupil, PolygonMembershipAgreesWithItsArea) {
  Pupil polygon = Circle(1);
  polygon.blades = 6;
  polygon.rotation_rad = 0.4;
  const double outer = polygon.OuterRadius();
  int inside = 0;
  constexpr int kSteps = 600;
  for (int i = 0; i < kSteps; ++i) {
    for (int j = 0; j < kSteps; ++j) {
      inside += polygon.Transmission(outer * (2 * (j + 0.5) / kSteps - 1),
                                     outer * (2 * (i + 0.5) / kSteps - 1)) > 0;
    }
  }
  // Rim cells, some 4 * 600, err by less than half each and at random.
  EXPECT_NEAR(4 * outer * outer * inside / (kSteps * kSteps), pi, 2e-3);
  EXPECT_EQ(polygon.Transmission(0.999 * outer * std::cos(0.4), 0.999 * outer * std::sin(0.4)), 1);
  EXPECT_EQ(polygon.Transmission(0.999 * outer * std::cos(0.4 + pi / 6),
                                 0.999 * outer * std::sin(0.4 + pi / 6)),
            0);
}

TEST(Pupil, SubPixelsFollowTheRule) {
  // os >= 2 p D / (lambda b).
  EXPECT_EQ(RequiredSubPixels(0.016 / 22, 661e-9, 0.0168, 5.3e-6), 2);
  EXPECT_EQ(RequiredSubPixels(0.016 / 2, 661e-9, 0.0168, 5.3e-6), 8);
  EXPECT_EQ(RequiredSubPixels(0.016 / 1.4, 661e-9, 0.0168, 5.3e-6), 11);
  const double exactly_three = 3 * 661e-9 * 0.0168 / (2 * 5.3e-6);
  EXPECT_EQ(RequiredSubPixels(exactly_three, 661e-9, 0.0168, 5.3e-6), 3);
  EXPECT_EQ(RequiredSubPixels(exactly_three * 1.0001, 661e-9, 0.0168, 5.3e-6), 4);
}

TEST(AmplitudeTransfer, HasUnitMeanSquareAndThePhaseOfDefocus) {
  const double cut_off = 0.45;
  const double curvature = 0.4;
  const int columns = 96, rows = 80, sub_pixels = 2;
  const Image<std::complex<float>> transfer =
      AmplitudeTransfer(Circle(PupilRadius(cut_off)), kWavelength_m, kImageDistance_m, curvature,
                        columns, rows, kPitch_m / sub_pixels);
  double squares = 0;
  for (const std::complex<float> value : transfer.values) squares += std::norm(value);
  EXPECT_NEAR(squares / (columns * rows), 1, 1e-5);
  // W = -1/2 curvature r^2, r = lambda b q.
  const int k = 5, l = -7;
  const double qx = k / (columns * kPitch_m / sub_pixels);
  const double qy = l / (rows * kPitch_m / sub_pixels);
  const double r2 = std::pow(kWavelength_m * kImageDistance_m, 2) * (qx * qx + qy * qy);
  const double phase = -pi / kWavelength_m * curvature * r2;
  const std::complex<float> value = transfer.At(rows + l, k);
  EXPECT_NEAR(value.real() / std::abs(value), std::cos(phase), 1e-5);
  EXPECT_NEAR(value.imag() / std::abs(value), std::sin(phase), 1e-5);
}

TEST(OpticalTransfer, ClosedFormIsTheNumericAutocorrelation) {
  const Pupil clear = Circle(1e-3);
  Pupil numeric = clear;
  numeric.zernike_m = {0, 0, 0};  // no error, but no closed form either
  const double cut_off = 2e-3 / (kWavelength_m * kImageDistance_m);
  const OpticalTransferTable clear_table(clear, kWavelength_m, kImageDistance_m);
  const OpticalTransferTable table(numeric, kWavelength_m, kImageDistance_m);
  for (const double share : {0.0, 0.1, 0.37, 0.5, 0.8, 0.99, 1.2}) {
    for (const double angle : {0.0, 0.5, 2.0}) {
      const double qx = share * cut_off * std::cos(angle);
      const double qy = share * cut_off * std::sin(angle);
      const double closed = OpticalTransfer(clear, kWavelength_m, kImageDistance_m, qx, qy).real();
      const std::complex<double> sum =
          OpticalTransfer(numeric, kWavelength_m, kImageDistance_m, qx, qy);
      // A rim sampled at 512 places across: 4 * 512 cells, each off by half at most, at random.
      EXPECT_NEAR(sum.real(), closed, 1e-3) << share;
      EXPECT_NEAR(sum.imag(), 0, 1e-9);
      EXPECT_NEAR(clear_table.At(qx, qy).real(), closed, 1e-6);
      EXPECT_NEAR(table.At(qx, qy).real(), closed, 3e-3) << share;
    }
  }
  EXPECT_EQ(OpticalTransfer(clear, kWavelength_m, kImageDistance_m, 0, 0).real(), 1);
}

TEST(OpticalTransfer, SmallAberrationLowersTheVolumeByTheStrehlRatio) {
  // Integral of the OTF over that of the perfect one is the Strehl ratio, here the Marechal
  // approximation exp(-(2 pi W)^2) of rms error W = lambda/20 to its next order.
  Pupil aberrated = Circle(1e-3);
  aberrated.zernike_m.assign(11, 0);
  aberrated.zernike_m[5] = kWavelength_m / 20;  // astigmatism
  const OpticalTransferTable with(aberrated, kWavelength_m, kImageDistance_m);
  const OpticalTransferTable without(Circle(1e-3), kWavelength_m, kImageDistance_m);
  const double cut_off = 2e-3 / (kWavelength_m * kImageDistance_m);
  double sum = 0, reference = 0;
  for (int i = -60; i <= 60; ++i) {
    for (int j = -60; j <= 60; ++j) {
      sum += with.At(j * cut_off / 60, i * cut_off / 60).real();
      reference += without.At(j * cut_off / 60, i * cut_off / 60).real();
    }
  }
  EXPECT_NEAR(sum / reference, std::exp(-std::pow(2 * pi / 20, 2)), 3e-3);
}

}  // namespace
}  // namespace sightline
