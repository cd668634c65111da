// SPDX-License-Identifier: Apache-2.0
#include "render_worker/sensor/expose.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "tests/render_worker/sensor/chi_squared.h"

namespace sightline {
namespace {

FrameSetup MonoFrame(int columns, int rows) {
  FrameSetup frame;
  frame.sensor.quantum_efficiency[0] = {{0}, {0.53}};
  frame.sensor.dark_mean_electrons = 27.57;
  frame.sensor.dark_noise_electrons = 6.5;
  frame.roi = {-columns / 2, -rows / 2, columns, rows};
  frame.seeds = {1, 2, 3, 4};
  frame.exposure_time_s = 0.02;
  return frame;
}

double Mean(const Image<double>& image) {
  double sum = 0;
  for (const double value : image.values) sum += value;
  return sum / image.values.size();
}

double Variance(const Image<double>& image) {
  const double mean = Mean(image);
  double sum = 0;
  for (const double value : image.values) sum += (value - mean) * (value - mean);
  return sum / (image.values.size() - 1);
}

TEST(MeanPhotoElectrons, CountsPhotonsOfLaserAndOtherLight) {
  FrameSetup frame = MonoFrame(2, 2);
  frame.sensor.colour_filter = ColourFilter::kBayerRggb;
  frame.sensor.quantum_efficiency = {{{{0}, {0.48}}, {{0}, {0.09}}, {{0}, {0.03}}}};
  frame.roi = {-1, -3, 2, 2};  // first pixel: odd row, odd column, blue
  PixelIrradiance light;
  light.roi = frame.roi;
  light.laser_irradiance_w_m2 = Image<float>(2, 2, 1e-3F);
  const double photons = 1e-3F * 5.3e-6 * 5.3e-6 * 0.02 * 661e-9 / (6.62607015e-34 * 299792458.0);
  const Image<double> laser = MeanPhotoElectrons(light, frame);
  EXPECT_NEAR(laser.At(0, 0), 0.03 * photons, 1e-9 * photons);
  EXPECT_NEAR(laser.At(0, 1), 0.09 * photons, 1e-9 * photons);
  EXPECT_NEAR(laser.At(1, 0), 0.09 * photons, 1e-9 * photons);
  EXPECT_NEAR(laser.At(1, 1), 0.48 * photons, 1e-9 * photons);

  light.incoherent_electron_flux_m2_s = {Image<float>(2, 2, 1e15F), Image<float>(2, 2, 2e15F),
                                         Image<float>(2, 2, 3e15F)};
  const double area_time = 5.3e-6 * 5.3e-6 * 0.02;
  const Image<double> both = MeanPhotoElectrons(light, frame);
  EXPECT_NEAR(both.At(0, 0) - laser.At(0, 0), 3e15 * area_time, 1e-6 * 3e15 * area_time);
  EXPECT_NEAR(both.At(0, 1) - laser.At(0, 1), 2e15 * area_time, 1e-6 * 2e15 * area_time);
  EXPECT_NEAR(both.At(1, 1) - laser.At(1, 1), 1e15 * area_time, 1e-6 * 1e15 * area_time);

  frame.laser_on = false;
  EXPECT_NEAR(MeanPhotoElectrons(light, frame).At(1, 1), 1e15 * area_time, 1e-6 * 1e15 * area_time);
  frame.shutter_open = false;
  EXPECT_EQ(MeanPhotoElectrons(light, frame), Image<double>(2, 2, 0));
}

// e = Poisson(eta mu_p) + Normal(mu_d, sigma_d^2), y = round(K e), by the exact law of y.
TEST(CollectElectrons, NullSensorHasTheLawOfTheRecordingsFormat) {
  FrameSetup frame = MonoFrame(512, 512);
  for (const double mean : {0.0, 3.0, 40.0, 2000.0}) {
    const Image<uint16_t> raw =
        Digitise(CollectElectrons(Image<double>(512, 512, mean), frame), frame.sensor);
    const double gain = frame.sensor.gain_dn_per_electron;
    const int last = static_cast<int>(gain * (mean + 8 * std::sqrt(mean) + 27.57 + 60));
    std::vector<double> counts(last + 1), expected(last + 1);
    for (const uint16_t dn : raw.values) {
      ASSERT_LE(dn, last);
      ++counts[dn];
    }
    const auto normal_below = [&](double electrons) {
      return 0.5 * std::erfc(-(electrons - 27.57) / (6.5 * std::numbers::sqrt2));
    };
    const int largest_k = static_cast<int>(mean + 9 * std::sqrt(mean) + 30);
    for (int k = 0; k <= largest_k; ++k) {
      const double p =
          mean == 0 ? (k == 0) : std::exp(k * std::log(mean) - mean - std::lgamma(k + 1.0));
      if (p < 1e-15) continue;
      for (int dn = 0; dn <= last; ++dn) {
        const double below = dn == 0 ? 0 : normal_below((dn - 0.5) / gain - k);
        expected[dn] += raw.values.size() * p * (normal_below((dn + 0.5) / gain - k) - below);
      }
    }
    EXPECT_GT(GoodnessOfFit(counts, expected), 1e-4) << mean;
  }
}

TEST(CollectElectrons, ASmallerRegionHasTheSamePixels) {
  FrameSetup frame = MonoFrame(64, 48);
  frame.sensor.prnu_relative = 0.02;
  frame.sensor.dsnu_electrons = 5;
  frame.sensor.dark_current_electrons_per_s = 300;
  Image<double> light(64, 48);
  for (int i = 0; i < 48; ++i) {
    for (int j = 0; j < 64; ++j) light.At(i, j) = i * 17.0 + j;
  }
  const Image<double> whole = CollectElectrons(light, frame);
  EXPECT_EQ(whole, CollectElectrons(light, frame));

  FrameSetup part = frame;
  part.roi = {frame.roi.column_px + 10, frame.roi.row_px + 20, 30, 9};
  Image<double> part_light(30, 9);
  for (int i = 0; i < 9; ++i) {
    for (int j = 0; j < 30; ++j) part_light.At(i, j) = light.At(i + 20, j + 10);
  }
  const Image<double> cut = CollectElectrons(part_light, part);
  for (int i = 0; i < 9; ++i) {
    for (int j = 0; j < 30; ++j) ASSERT_EQ(cut.At(i, j), whole.At(i + 20, j + 10));
  }
}

TEST(CollectElectrons, FramesDifferInNoiseAndShareTheFixedPattern) {
  FrameSetup frame = MonoFrame(128, 128);
  frame.sensor.dark_noise_electrons = 0;
  frame.sensor.dsnu_electrons = 50;
  const Image<double> dark(128, 128, 0);
  const Image<double> first = CollectElectrons(dark, frame);
  frame.seeds.noise = 77;
  EXPECT_EQ(CollectElectrons(dark, frame), first);  // without light nothing else is random
  frame.seeds.camera = 78;
  EXPECT_NE(CollectElectrons(dark, frame), first);
  frame.seeds.camera = 3;
  const Image<double> light(128, 128, 500);
  const Image<double> a = CollectElectrons(light, frame);
  frame.seeds.noise = 79;
  EXPECT_NE(CollectElectrons(light, frame), a);
}

// Sensitivities multiply: the spatial variance of many frames' mean is (PRNU mu)^2, that of one
// frame has the photons' besides.
TEST(CollectElectrons, PatternAddsItsVariance) {
  FrameSetup frame = MonoFrame(256, 256);
  frame.sensor.prnu_relative = 0.03;
  frame.sensor.dsnu_electrons = 20;
  frame.sensor.dark_mean_electrons = 200;
  const double mean = 4000, pixels = 256 * 256;
  const Image<double> electrons = CollectElectrons(Image<double>(256, 256, mean), frame);
  const double variance = mean + 6.5 * 6.5 + 20 * 20 + std::pow(0.03 * mean, 2);
  EXPECT_NEAR(Mean(electrons), mean + 200, 4 * std::sqrt(variance / pixels));
  EXPECT_NEAR(Variance(electrons), variance, 4 * variance * std::sqrt(2 / pixels));
}

TEST(CollectElectrons, DarkCurrentGrowsWithTimeAndDoublesWithTemperature) {
  FrameSetup frame = MonoFrame(256, 256);
  frame.sensor.dark_current_electrons_per_s = 1000;
  frame.sensor.dark_current_doubling_k = 7;
  frame.exposure_time_s = 0.4;
  EXPECT_EQ(DarkCurrentElectrons(frame), 400);
  frame.sensor_temperature_c = 25 + 14;
  EXPECT_NEAR(DarkCurrentElectrons(frame), 1600, 1e-9);
  const Image<double> electrons = CollectElectrons(Image<double>(256, 256, 0), frame);
  const double variance = 1600 + 6.5 * 6.5, pixels = 256 * 256;
  EXPECT_NEAR(Mean(electrons), 1600 + 27.57, 4 * std::sqrt(variance / pixels));
  EXPECT_NEAR(Variance(electrons), variance, 4 * variance * std::sqrt(2 / pixels));
}

TEST(CollectElectrons, StaysBetweenEmptyAndFull) {
  FrameSetup frame = MonoFrame(64, 64);
  frame.sensor.dark_mean_electrons = 0;
  Image<double> light(64, 64, 0);
  for (int j = 0; j < 64; ++j) {
    light.At(1, j) = 1e5;
    light.At(2, j) = 1e30;
    light.At(3, j) = std::nan("");
    light.At(4, j) = -5;
  }
  const Image<double> electrons = CollectElectrons(light, frame);
  double zeros = 0;
  for (int i = 0; i < 64; ++i) {
    for (int j = 0; j < 64; ++j) {
      const double e = electrons.At(i, j);
      ASSERT_GE(e, 0);
      ASSERT_LE(e, 9893);
      if (i == 1 || i == 2) {
        ASSERT_EQ(e, 9893);
      } else {
        ASSERT_LT(e, 6.5 * 6);
        zeros += e == 0;
      }
    }
  }
  // Half of the dark pixels are clipped.
  const double pixels = 62 * 64;
  EXPECT_NEAR(zeros / pixels, 0.5, 4 * std::sqrt(0.25 / pixels));
}

TEST(Digitise, RoundsAndClips) {
  Sensor sensor;
  sensor.gain_dn_per_electron = 0.5;
  sensor.bit_depth_bit = 8;
  Image<double> electrons(6, 1);
  electrons.values = {0, 0.99, 1, 100, 509.9, 1e4};
  EXPECT_EQ(Digitise(electrons, sensor).values, (std::vector<uint16_t>{0, 0, 1, 50, 255, 255}));
  sensor.black_level_dn = 10;
  EXPECT_EQ(Digitise(electrons, sensor).values, (std::vector<uint16_t>{10, 10, 11, 60, 255, 255}));
  sensor.bit_depth_bit = 16;
  EXPECT_EQ(Digitise(electrons, sensor).values.back(), 5010);
}

}  // namespace
}  // namespace sightline
