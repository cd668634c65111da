// SPDX-License-Identifier: Apache-2.0
#include "render_worker/optics/image_optics.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "render_worker/optics/laser_imaging.h"
#include "test_optics.h"

namespace sightline {
namespace {

using namespace optics_test;
using std::numbers::pi;

double Sum(const Image<float>& image) {
  return std::accumulate(image.values.begin(), image.values.end(), 0.0);
}

SpeckleModel NoSpeckle() {
  SpeckleModel speckle;
  speckle.on = false;
  return speckle;
}

Image<float> LaserPart(const IdealImage& image, const OpticsModel& optics,
                       const SpeckleModel& speckle, int threads = 2) {
  return ApplyOptics(image, optics, speckle, threads).laser_irradiance_w_m2;
}

// A line of Gaussian profile [sigma in px] about v = centre_px.
IdealImage LineImage(int columns_px, int rows_px, int sub_pixels, int margin_px, double sigma_px,
                     double centre_px) {
  IdealImage image = EvenImage(columns_px, rows_px, sub_pixels, margin_px);
  for (int i = 0; i < image.grid.rows(); ++i) {
    const double v = image.grid.V(i) / kPitch_m - centre_px;
    for (int j = 0; j < image.grid.columns(); ++j) {
      image.laser_irradiance_w_m2.At(i, j) =
          static_cast<float>(std::exp(-v * v / (2 * sigma_px * sigma_px)));
    }
  }
  return image;
}

double RelativeRms(const Image<float>& a, const Image<float>& b) {
  double squares = 0, level = 0;
  for (size_t i = 0; i < a.values.size(); ++i) {
    squares += std::pow(a.values[i] - b.values[i], 2);
    level += std::pow(b.values[i], 2);
  }
  return std::sqrt(squares / level);
}

TEST(ImageOptics, LightIsConserved) {
  for (const double depth : {kFocus_m, 0.26}) {
    IdealImage image = LineImage(40, 160, 3, 0, 4, 0.3);
    image.constant_depth_m = depth;
    // A spot: nothing beyond it in any direction.
    for (int i = 0; i < image.grid.rows(); ++i) {
      for (int j = 0; j < image.grid.columns(); ++j) {
        const double u = image.grid.U(j) / kPitch_m;
        image.laser_irradiance_w_m2.At(i, j) *= static_cast<float>(std::exp(-u * u / 8));
      }
    }
    const double in = Sum(image.laser_irradiance_w_m2) / 9;
    const OpticsModel optics = ClearLens(0.7);
    const double out = Sum(LaserPart(image, optics, NoSpeckle()));
    EXPECT_LT(out, in * (1 + 1e-5));
    // 20 px from the rim of the region: 1/(pi^2 q_c r) passes at most.
    EXPECT_GT(out, in * (1 - 1 / (pi * pi * 0.7 * 12) * (depth == kFocus_m ? 1 : 2)));
  }
}

TEST(ImageOptics, EvenLightStaysEven) {
  const IdealImage image = EvenImage(48, 40, 2, 120);
  const Image<float> out = LaserPart(image, ClearLens(0.45), NoSpeckle());
  for (const float value : out.values) {
    // Light from beyond the margin is missing, less than 1/(pi^2 q_c margin).
    EXPECT_GT(value, 1 - 1 / (pi * pi * 0.45 * 120));
    EXPECT_LT(value, 1 + 1e-4);
  }
}

TEST(ImageOptics, LineKeepsItsPlaceForEvenAndOddSubPixels) {
  for (const int sub_pixels : {2, 3, 4, 5}) {
    const IdealImage image = LineImage(8, 60, sub_pixels, 20, 3, 0.37);
    const Image<float> out = LaserPart(image, ClearLens(0.45), NoSpeckle());
    double sum = 0, moment = 0;
    for (int i = 0; i < 60; ++i) {
      sum += out.At(i, 4);
      moment += out.At(i, 4) * (i - 30);
    }
    // Diffracted tails cut unevenly: 2/(pi^2 q_c 30) of the light is outside, and the line is 0.37
    // px off centre: 30 px times the difference of the two sides' shares.
    EXPECT_NEAR(moment / sum, 0.37, 0.37 * 2 / (pi * pi * 0.45 * 30) * 2) << sub_pixels;
  }
}

TEST(ImageOptics, PixelMeanIsExactForAKnownSignal) {
  // Even light with a cosine within the lens's band: amplitude times OTF and sinc, any parity.
  for (const int sub_pixels : {2, 3, 4}) {
    const double frequency = 0.25;  // cycles per pixel; the region holds whole periods
    IdealImage image = EvenImage(16, 64, sub_pixels, 200);
    for (int i = 0; i < image.grid.rows(); ++i) {
      const double v = image.grid.V(i) / kPitch_m;
      for (int j = 0; j < image.grid.columns(); ++j) {
        image.laser_irradiance_w_m2.At(i, j) =
            static_cast<float>(1 + 0.8 * std::cos(2 * pi * frequency * v + 0.4));
      }
    }
    const OpticsModel optics = ClearLens(0.45);
    const Image<float> out = LaserPart(image, optics, NoSpeckle());
    std::complex<double> amplitude = 0;
    for (int i = 0; i < 64; ++i) {
      amplitude +=
          std::polar(2.0 / 64, -2 * pi * frequency * (i - 32)) * static_cast<double>(out.At(i, 8));
    }
    const double transfer = OpticalTransfer(optics.pupil(0, 0), kWavelength_m, kImageDistance_m, 0,
                                            frequency / kPitch_m)
                                .real();
    const double expected = 0.8 * transfer * std::sin(pi * frequency) / (pi * frequency);
    // Missing light from beyond the margin, and the rim of the sampled pupil (some 10^5 samples).
    EXPECT_NEAR(std::abs(amplitude), expected, 2e-3) << sub_pixels;
    EXPECT_NEAR(std::arg(amplitude), 0.4, 2e-3) << sub_pixels;
  }
}

TEST(ImageOptics, RayleighResolution) {
  // Two points 1.22 lambda N' apart: the saddle is at 73.5 % of the peaks.
  const double distance_px = 14;
  const double airy_px = distance_px / 1.21967;  // lambda N'
  const OpticsModel optics = ClearLens(1 / (2 * airy_px));
  IdealImage image;
  image.incoherent_grid = {{-256, -256, 512, 512}, 1, 0, kPitch_m};
  image.grid = image.incoherent_grid;
  image.incoherent_wavelength_m[0] = kWavelength_m;
  image.incoherent_electron_flux_m2_s[0] = Image<float>(512, 512);
  image.incoherent_electron_flux_m2_s[0].At(256, 256 - 7) = 1;
  image.incoherent_electron_flux_m2_s[0].At(256, 256 + 7) = 1;
  const PixelIrradiance light = ApplyOptics(image, optics, NoSpeckle(), 2);
  const Image<float>& out = light.incoherent_electron_flux_m2_s[0];
  // The whole pattern's rings go on beyond 256 px: 2 / (pi^2 ...) of the light, spread thinly.
  EXPECT_NEAR(out.At(256, 256) / out.At(256, 249), 0.735, 2e-3);
  EXPECT_NEAR(Sum(out), 2, 1e-4);
  EXPECT_TRUE(light.incoherent_electron_flux_m2_s[1].empty());
}

TEST(ImageOptics, DefocusedPointIsADiscOfTheGeometricDiameter) {
  const double cut_off = 0.7;
  const double depth = 0.12;
  IdealImage image = EvenImage(96, 96, 3, 0);
  std::fill(image.laser_irradiance_w_m2.values.begin(), image.laser_irradiance_w_m2.values.end(),
            0.0F);
  image.laser_irradiance_w_m2.At(48 * 3 + 1, 48 * 3 + 1) = 9;  // one pixel's worth, its centre
  image.constant_depth_m = depth;
  const Image<float> out = LaserPart(image, ClearLens(cut_off), NoSpeckle());
  // 2 R b |1/b' - 1/b|.
  const double radius_px =
      PupilRadius(cut_off) * kImageDistance_m * std::abs(Curvature(depth)) / kPitch_m;
  ASSERT_GT(radius_px, 10);
  ASSERT_LT(radius_px, 45);
  // Mean over rings.
  std::vector<double> sum(96), count(96);
  for (int i = 0; i < 96; ++i) {
    for (int j = 0; j < 96; ++j) {
      const double r = std::hypot(i - 48, j - 48);
      sum[static_cast<size_t>(r)] += out.At(i, j);
      count[static_cast<size_t>(r)] += 1;
    }
  }
  const double level = 1 / (pi * radius_px * radius_px);
  double inside = 0;
  for (int i = 0; i < 96; ++i) {
    for (int j = 0; j < 96; ++j)
      inside += std::hypot(i - 48, j - 48) < radius_px ? out.At(i, j) : 0;
  }
  // The shadow of a straight edge: 1/4 of the level at the geometric rim.
  double rim = 0;
  for (int r = static_cast<int>(radius_px) / 2; r < 60; ++r) {
    const double here = sum[r] / count[r], next = sum[r + 1] / count[r + 1];
    if (here >= level / 4 && next < level / 4) {
      rim = r + 0.5 + (here - level / 4) / (here - next);
      break;
    }
  }
  EXPECT_NEAR(rim, radius_px, 0.5);  // half a ring of one pixel
  // Fresnel fringes pass little of the light over the rim: half of sqrt(lambda b/..)/R.
  EXPECT_GT(inside, 0.9);
}

TEST(ImageOptics, NothingWrapsAround) {
  // Light on the left rim only: the right rim sees less than the middle.
  IdealImage image = EvenImage(240, 40, 2, 0);
  for (int i = 0; i < image.grid.rows(); ++i) {
    for (int j = 8; j < image.grid.columns(); ++j) image.laser_irradiance_w_m2.At(i, j) = 0;
  }
  const Image<float> out = LaserPart(image, ClearLens(0.45), NoSpeckle());
  const auto mean = [&](int begin, int end) {
    double sum = 0;
    for (int i = 0; i < 40; ++i) {
      for (int j = begin; j < end; ++j) sum += out.At(i, j);
    }
    return sum / (40.0 * (end - begin));
  };
  // Tails of lines fall with the square of the distance: 1/(2 pi^2 q_c x^2) a pixel of light, or
  // faster where the line is short.
  const double expected = 4 / (2 * pi * pi * 0.45 * 100 * 100);
  EXPECT_LT(mean(90, 110), 1.5 * expected);
  EXPECT_LT(mean(220, 240), mean(90, 110) * 0.45);
}

TEST(ImageOptics, SameBytesForAnyNumberOfThreads) {
  IdealImage image = LineImage(70, 50, 3, 12, 3, 0.4);
  image.depth_m = Image<float>(image.grid.columns(), image.grid.rows());
  for (int i = 0; i < image.grid.rows(); ++i) {
    for (int j = 0; j < image.grid.columns(); ++j) {
      image.depth_m.At(i, j) = 0.3F + 1e-4F * static_cast<float>(j);
    }
  }
  image.incoherent_grid = {image.grid.roi, 1, 4, kPitch_m};
  image.incoherent_electron_flux_m2_s[0] = Image<float>(78, 58, 2.0F);
  OpticsModel optics = ClearLens(0.7);
  for (const bool field_dependent : {false, true}) {
    optics.field_dependent = field_dependent;
    const PixelIrradiance one = ApplyOptics(image, optics, SpeckleModel(), 1);
    const PixelIrradiance three = ApplyOptics(image, optics, SpeckleModel(), 3);
    EXPECT_EQ(one.laser_irradiance_w_m2, three.laser_irradiance_w_m2);
    EXPECT_EQ(one.incoherent_electron_flux_m2_s[0], three.incoherent_electron_flux_m2_s[0]);
    EXPECT_EQ(LaserPart(image, optics, NoSpeckle(), 1), LaserPart(image, optics, NoSpeckle(), 2));
  }
}

TEST(ImageOptics, EqualDepthsAreOneDepth) {
  IdealImage image = LineImage(50, 40, 3, 12, 3, 0.4);
  image.constant_depth_m = 0.28125;  // exact in single precision
  const OpticsModel optics = ClearLens(0.7);
  const Image<float> constant = LaserPart(image, optics, SpeckleModel());
  image.depth_m = Image<float>(image.grid.columns(), image.grid.rows(), 0.28125F);
  EXPECT_EQ(LaserPart(image, optics, SpeckleModel()), constant);
}

TEST(ImageOptics, BlocksDifferByTheCutPointSpreadOnly) {
  const IdealImage image = LineImage(200, 120, 2, 40, 12, 3);
  OpticsModel optics = ClearLens(0.45);
  const Image<float> whole = LaserPart(image, optics, SpeckleModel());
  optics.field_dependent = true;  // the same pupil everywhere, but in blocks
  ASSERT_GT(PlanLaserTransforms(image, optics, 1).size(), 3u);
  ASSERT_EQ(PlanLaserTransforms(image, ClearLens(0.45), 1).size(), 1u);
  const Image<float> blocks = LaserPart(image, optics, SpeckleModel());
  // A share of 1e-3 of the light is cut: sqrt(1e-3) of the field, twice that of the irradiance, and
  // both divisions wrap theirs.
  EXPECT_LT(RelativeRms(blocks, whole), 2 * std::sqrt(2e-3));
  EXPECT_NEAR(Sum(blocks) / Sum(whole), 1, 1e-3);
}

TEST(ImageOptics, OtherRegionsSeeTheSameScatterers) {
  const IdealImage image = LineImage(160, 80, 2, 60, 8, 0);
  const OpticsModel optics = ClearLens(0.45);
  const Image<float> whole = LaserPart(image, optics, SpeckleModel());
  IdealImage part = image;
  part.grid.roi = {-30, -20, 61, 45};
  part.laser_irradiance_w_m2 = Image<float>(part.grid.columns(), part.grid.rows());
  for (int i = 0; i < part.grid.rows(); ++i) {
    const double v = part.grid.V(i) / kPitch_m;
    for (int j = 0; j < part.grid.columns(); ++j) {
      part.laser_irradiance_w_m2.At(i, j) = static_cast<float>(std::exp(-v * v / 128));
    }
  }
  const Image<float> small = LaserPart(part, optics, SpeckleModel());
  Image<float> cut(61, 45);
  for (int i = 0; i < 45; ++i) {
    for (int j = 0; j < 61; ++j) cut.At(i, j) = whole.At(i + 20, j + 50);
  }
  // Light from beyond 60 px is missing: 1/(pi^2 q_c 60) of it, twice the root for the irradiance.
  EXPECT_LT(RelativeRms(small, cut), 2 * std::sqrt(1 / (pi * pi * 0.45 * 60)));
}

TEST(ImageOptics, DarkImageIsDark) {
  IdealImage image = EvenImage(20, 16, 2, 4);
  std::fill(image.laser_irradiance_w_m2.values.begin(), image.laser_irradiance_w_m2.values.end(),
            0.0F);
  EXPECT_EQ(Sum(LaserPart(image, ClearLens(0.45), SpeckleModel())), 0);
  EXPECT_TRUE(PlanLaserTransforms(image, ClearLens(0.45), 1).empty());
}

TEST(ImageOptics, VignettingTakesItsShareOfTheLight) {
  const IdealImage image = EvenImage(64, 64, 2, 100);
  OpticsModel optics = ClearLens(0.45);
  const double open = Sum(LaserPart(image, optics, NoSpeckle()));
  Pupil cut = optics.pupil(0, 0);
  cut.clips = {{cut.radius_m, 0, cut.radius_m}};
  optics.pupil = [cut](double, double) { return cut; };
  const double clipped = Sum(LaserPart(image, optics, NoSpeckle()));
  // Light missing from beyond the margin differs by at most its whole.
  EXPECT_NEAR(clipped / open, 2.0 / 3 - std::sqrt(3.0) / (2 * pi), 2 / (pi * pi * 0.45 * 100));
  optics.field_dependent = true;
  EXPECT_NEAR(Sum(LaserPart(image, optics, NoSpeckle())) / clipped, 1, 1e-3);
}

TEST(ImageOptics, UnitTransferFunctionChangesNothing) {
  const IdealImage image = LineImage(60, 50, 3, 12, 3, 0.4);
  OpticsModel optics = ClearLens(0.7);
  const Image<float> without = LaserPart(image, optics, SpeckleModel());
  optics.transfer = {[](double, double) { return std::complex<double>(1); }};
  const Image<float> with = LaserPart(image, optics, SpeckleModel());
  // Another period, as the reach is larger, so another sampling of the pupil's rim: the cut share.
  EXPECT_LT(RelativeRms(with, without), 2 * std::sqrt(2e-3));
  EXPECT_NEAR(Sum(with) / Sum(without), 1, 1e-3);
}

TEST(ImageOptics, HaloSpreadsLightAndKeepsIt) {
  // Halo of share g, exp(-r/r0)/(2 pi r0^2): transfer 1 - g + g (1 + (2 pi r0 q)^2)^(-3/2).
  const double r0_m = 6 * kPitch_m, share = 0.2;
  IdealImage image = EvenImage(160, 160, 2, 0);
  std::fill(image.laser_irradiance_w_m2.values.begin(), image.laser_irradiance_w_m2.values.end(),
            0.0F);
  for (int i = 0; i < 2; ++i) {
    for (int j = 0; j < 2; ++j) image.laser_irradiance_w_m2.At(160 + i, 160 + j) = 1;
  }
  OpticsModel optics = ClearLens(0.45);
  const Image<float> without = LaserPart(image, optics, NoSpeckle());
  optics.transfer = {[=](double qx, double qy) {
    const double square = std::pow(2 * pi * r0_m, 2) * (qx * qx + qy * qy);
    return std::complex<double>(1 - share + share * std::pow(1 + square, -1.5));
  }};
  const Image<float> with = LaserPart(image, optics, NoSpeckle());
  EXPECT_NEAR(Sum(with) / Sum(without), 1, 2e-3);
  // 12 px away the halo rules: difference to the diminished lens's own tail.
  const double halo = share * std::exp(-2.0) / (2 * pi * 36);
  EXPECT_NEAR(with.At(80, 92) - (1 - share) * without.At(80, 92), halo, 0.05 * halo);
  EXPECT_GT(RequiredMargin(optics, 0, kPitch_m), RequiredMargin(ClearLens(0.45), 0, kPitch_m) + 20);
}

TEST(ImageOptics, MarginHoldsTheEnergyItPromises) {
  // Rayleigh's encircled energy 1 - J0^2 - J1^2 at the margin.
  for (const double lost : {1e-2, 1e-3}) {
    const OpticsModel optics = ClearLens(0.7);
    const int margin = RequiredMargin(optics, 0, kPitch_m, 0, lost);
    const double v = 2 * pi * 0.7 * margin;
    const double outside =
        std::pow(std::cyl_bessel_j(0, v), 2) + std::pow(std::cyl_bessel_j(1, v), 2);
    EXPECT_LT(outside, lost);
    EXPECT_GT(outside, 0.8 * lost);
  }
}

TEST(ImageOptics, MarginOfACutPupil) {
  // A rim inside the pupil is the pupil.
  OpticsModel cut = ClearLens(0.7);
  Pupil pupil = cut.pupil(0, 0);
  const double radius = pupil.radius_m;
  pupil.clips = {{0, 0, 0.5 * radius}};
  cut.pupil = [&pupil](double, double) { return pupil; };
  EXPECT_NEAR(RequiredMargin(cut, 0, kPitch_m, 0, 1e-2),
              RequiredMargin(ClearLens(0.35), 0, kPitch_m, 0, 1e-2), 1);
  // However little is left, the margin has an end.
  for (const double clear : {1e-2, 1e-5, 0.0}) {
    pupil.clips = {{(2 - clear) * radius, 0, radius}};
    const int margin = RequiredMargin(cut, 0, kPitch_m);
    EXPECT_GT(margin, 0);
    EXPECT_LE(margin, 1024);
  }
}

}  // namespace
}  // namespace sightline
