// SPDX-License-Identifier: Apache-2.0
// Effects of the sensor: conservation of charge, closed forms, statistics.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "core/random/counter_random.h"
#include "tests/render_worker/effects/test_frame.h"

namespace sightline {
namespace {

using Values = std::vector<std::pair<std::string, double>>;

Image<double> OnMean(const std::string& id, const Values& values, Image<double> image,
                     const Image<double>* previous = nullptr,
                     const FrameSetup& frame = TestFrame()) {
  const Effect& effect = TheEffect(id);
  effect.OnMeanElectrons(image, previous, frame, WithParameters(effect, values));
  return image;
}
Image<double> OnCharge(const std::string& id, const Values& values, Image<double> image,
                       const FrameSetup& frame = TestFrame()) {
  const Effect& effect = TheEffect(id);
  effect.OnElectrons(image, frame, WithParameters(effect, values));
  return image;
}

Image<double> Spot(double electrons) {
  Image<double> image(40, 25);
  image.At(12, 20) = electrons;
  return image;
}

TEST(Crosstalk, GoesToFourNeighboursAndKeepsCharge) {
  const Image<double> after =
      OnMean("sensor.crosstalk", {{"crosstalk_fraction", 0.03}}, Spot(1000));
  EXPECT_NEAR(after.At(12, 20), 880, 1e-9);
  for (const auto& [i, j] : {std::pair{11, 20}, {13, 20}, {12, 19}, {12, 21}}) {
    EXPECT_NEAR(after.At(i, j), 30, 1e-9);
  }
  EXPECT_EQ(after.At(11, 19), 0);
  const Image<double> random = RandomElectrons(TestFrame(), 3, 9000);
  EXPECT_NEAR(Sum(OnMean("sensor.crosstalk", {{"crosstalk_fraction", 0.1}}, random)) / Sum(random),
              1, 1e-12);
}

// The stated standard deviations are those of the offsets that images get.
TEST(LineOffsets, AreThoseOfTheImages) {
  FrameSetup frame = TestFrame();
  frame.roi = {-200, -200, 400, 400};
  for (const bool rows : {true, false}) {
    const char* id = rows ? "sensor.row_noise" : "sensor.dsnu_column_pattern";
    const Values values = {{rows ? "row_noise_electrons" : "column_offset_electrons", 7}};
    const Effect& effect = TheEffect(id);
    LineOffsets stated;
    effect.OnLineOffsets(stated, WithParameters(effect, values));
    EXPECT_EQ(stated.row_electrons, rows ? 7 : 0);
    EXPECT_EQ(stated.column_electrons, rows ? 0 : 7);
    const Image<double> image = OnCharge(id, values, Image<double>(400, 400, 0.0), frame);
    double square = 0;
    for (const double value : image.values) square += value * value;
    // 400 normal numbers: their standard deviation is known to 1/sqrt(800).
    EXPECT_NEAR(std::sqrt(square / static_cast<double>(image.values.size())), 7, 7 * 4 / 28.0);
    EXPECT_EQ(rows ? image.At(5, 0) : image.At(0, 5), image.At(5, rows ? 9 : 5)) << id;
  }
}

TEST(BrighterFatter, FlowIsTheFormulaAndKeepsCharge) {
  Image<double> pair(40, 25);
  pair.At(5, 5) = 8000;
  pair.At(5, 6) = 5000;
  const double a = 1e-6;
  const Image<double> after =
      OnCharge("sensor.brighter_fatter", {{"boundary_shift_per_electron", a}}, pair);
  // From 5000: gains from 8000 by a 6500 1500, loses to three empty neighbours a 2500 2500 each.
  EXPECT_NEAR(after.At(5, 6), 5000 + a * 6500 * 1500 - 3 * a * 2500 * 2500, 1e-9);
  EXPECT_NEAR(Sum(after) / Sum(pair), 1, 1e-12);
}

// Flat fields: correlated neighbours, variance below the mean (the photon-transfer curve bends).
TEST(BrighterFatter, LowersTheVarianceOfFlatFields) {
  const double mean = 8000, a = 1e-6;
  FrameSetup frame = TestFrame();
  frame.roi = {0, 0, 400, 300};
  Image<double> flat(400, 300);
  for (size_t i = 0; i < flat.values.size(); ++i) {
    flat.values[i] = mean + std::sqrt(mean) * CounterRandom(9, i).Normal();
  }
  const Image<double> after =
      OnCharge("sensor.brighter_fatter", {{"boundary_shift_per_electron", a}}, flat, frame);
  double before_variance = 0, variance = 0, covariance = 0;
  int count = 0;
  for (int i = 1; i < 299; ++i) {
    for (int j = 1; j < 399; ++j) {
      before_variance += std::pow(flat.At(i, j) - mean, 2);
      variance += std::pow(after.At(i, j) - mean, 2);
      covariance += (after.At(i, j) - mean) * (after.At(i, j + 1) - mean);
      ++count;
    }
  }
  // Linearised: q' = q (1 - 4 c) + c sum of neighbours, c = a mean/2: variance (1-4c)^2 + 4 c^2,
  // covariance of neighbours 2 c (1 - 4 c).
  const double c = a * mean / 2;
  EXPECT_NEAR(variance / before_variance, (1 - 4 * c) * (1 - 4 * c) + 4 * c * c, 1e-3);
  EXPECT_NEAR(covariance / count / mean, 2 * c * (1 - 4 * c), 4 / std::sqrt(count));
}

TEST(Blooming, SurplusRunsAlongTheColumnAndIsKept) {
  Image<double> image(3, 401);
  image.At(200, 1) = 30000;
  const Image<double> after =
      OnMean("sensor.blooming",
             {{"blooming_fraction", 0.5}, {"threshold_electrons", 10000}, {"reach_px", 4}}, image);
  EXPECT_NEAR(after.At(200, 1), 20000, 1e-9);
  EXPECT_NEAR(Sum(after), 30000, 1e-6);
  EXPECT_NEAR(after.At(203, 1) / after.At(204, 1), std::exp(0.25), 1e-9);
  EXPECT_NEAR(after.At(195, 1), after.At(205, 1), 1e-9);
  EXPECT_EQ(after.At(200, 0), 0);
  // Below the threshold nothing moves.
  const Image<double> dim = RandomElectrons(TestFrame(), 4, 9999);
  EXPECT_EQ(OnMean("sensor.blooming", {{"blooming_fraction", 1}}, dim).values, dim.values);
}

TEST(Smear, AddsTheColumnsShareEverywhere) {
  FrameSetup frame = TestFrame();
  const Image<double> after =
      OnMean("sensor.smear", {{"smear_relative", 0.02}}, Spot(10000), nullptr, frame);
  const double trail = 0.02 * 10000 / 1024;
  EXPECT_NEAR(after.At(0, 20), trail, 1e-12);
  EXPECT_NEAR(after.At(24, 20), trail, 1e-12);
  EXPECT_EQ(after.At(0, 19), 0);
}

// A bright frame followed by dark ones: all its charge comes out in the end.
TEST(ImageLag, KeepsChargeOverABurst) {
  const Values lag = {{"lag_fraction", 0.2}};
  Image<double> read = OnMean("sensor.image_lag", lag, Spot(1000));
  double total = Sum(read);
  EXPECT_NEAR(total, 800, 1e-9);
  for (int k = 1; k < 25; ++k) {
    const Image<double> next = OnMean("sensor.image_lag", lag, Image<double>(40, 25), &read);
    EXPECT_NEAR(Sum(next) / Sum(read), 0.2, 1e-9);
    read = next;
    total += Sum(read);
  }
  EXPECT_NEAR(total, 1000, 1e-9);
}

TEST(ResponseNonlinearity, IsTheParabola) {
  const FrameSetup frame = TestFrame();
  const double full = 1023 / 0.16;
  Image<double> image(2, 1);
  image.values = {0.5 * full, full};
  const Image<double> after =
      OnCharge("sensor.response_nonlinearity", {{"nonlinearity", 0.1}}, image, frame);
  EXPECT_NEAR(after.values[0], 0.5 * full * 0.95, 1e-9);
  EXPECT_NEAR(after.values[1], full * 0.9, 1e-9);
  // Monotone to the end.
  double before = -1;
  for (double e = 0; e < 3 * full; e += 50) {
    Image<double> one(1, 1, e);
    one = OnCharge("sensor.response_nonlinearity", {{"nonlinearity", 0.5}}, one);
    EXPECT_GE(one.values[0], before);
    before = one.values[0];
  }
}

TEST(ColumnPattern, IsFixedAndHasItsSpread) {
  FrameSetup frame = TestFrame();
  frame.roi = {-600, -5, 1200, 3};
  const Values values = {{"column_offset_electrons", 6}};
  const Image<double> flat(1200, 3, 100.0);
  const Image<double> a = OnCharge("sensor.dsnu_column_pattern", values, flat, frame);
  frame.seeds.noise += 1;
  EXPECT_EQ(OnCharge("sensor.dsnu_column_pattern", values, flat, frame).values, a.values);
  double mean = 0, square = 0;
  for (int j = 0; j < 1200; ++j) {
    EXPECT_EQ(a.At(0, j), a.At(2, j));
    mean += (a.At(0, j) - 100) / 1200;
    square += std::pow(a.At(0, j) - 100, 2) / 1200;
  }
  EXPECT_NEAR(mean, 0, 4 * 6 / std::sqrt(1200));
  EXPECT_NEAR(square / 36, 1, 4 * std::sqrt(2.0 / 1200));
}

TEST(RowNoise, JumpsWithEveryFrame) {
  FrameSetup frame = TestFrame();
  frame.roi = {-5, -500, 3, 1000};
  const Values values = {{"row_noise_electrons", 3}};
  const Image<double> flat(3, 1000, 100.0);
  const Image<double> a = OnCharge("sensor.row_noise", values, flat, frame);
  frame.seeds.noise += 1;
  const Image<double> b = OnCharge("sensor.row_noise", values, flat, frame);
  double square = 0, product = 0;
  for (int i = 0; i < 1000; ++i) {
    EXPECT_EQ(a.At(i, 0), a.At(i, 2));
    square += std::pow(a.At(i, 0) - 100, 2) / 1000;
    product += (a.At(i, 0) - 100) * (b.At(i, 0) - 100) / 1000;
  }
  EXPECT_NEAR(square / 9, 1, 4 * std::sqrt(2.0 / 1000));
  EXPECT_NEAR(product / 9, 0, 4 / std::sqrt(1000));
}

TEST(HotPixels, FractionAndMeanCurrent) {
  FrameSetup frame = TestFrame();
  frame.roi = {-500, -400, 1000, 800};
  frame.exposure_time_s = 0.1;
  const double fraction = 0.01;
  const Image<double> after = OnMean("sensor.hot_pixels", {{"hot_fraction", fraction}},
                                     Image<double>(1000, 800), nullptr, frame);
  int hot = 0;
  for (const double e : after.values) hot += e > 0;
  const double expected = fraction * 800000;
  EXPECT_NEAR(hot, expected, 4 * std::sqrt(expected));
  // Exponential of mean 5000/s x 0.1 s.
  EXPECT_NEAR(Sum(after) / hot / 500, 1, 4 / std::sqrt(expected));
  // Eight kelvin more double the current; the pixels stay.
  frame.sensor_temperature_c = 33;
  const Image<double> warm = OnMean("sensor.hot_pixels", {{"hot_fraction", fraction}},
                                    Image<double>(1000, 800), nullptr, frame);
  EXPECT_NEAR(Sum(warm) / Sum(after), 2, 1e-9);
}

// The factor belongs to the column of the sensor, whatever region is read out, and also left of the
// principal point.
TEST(ColumnGain, OddColumnsGainWhatEvenOnesLose) {
  const double d = 0.03;
  for (const int first_column : {-21, -20, -1, 0, 7, 8}) {
    FrameSetup frame = TestFrame();
    frame.roi = {first_column, -12, 9, 3};
    const Image<double> even_light(9, 3, 1000.0);
    const Image<double> after =
        OnCharge("sensor.column_gain", {{"gain_difference_relative", d}}, even_light, frame);
    for (int c = 0; c < 9; ++c) {
      const bool odd = std::abs(first_column + c) % 2 == 1;
      EXPECT_DOUBLE_EQ(after.At(1, c), odd ? 1000 + 500 * d : 1000 - 500 * d) << first_column;
    }
    // The mean of two neighbours stays.
    EXPECT_DOUBLE_EQ(after.At(2, 3) + after.At(2, 4), 2000);
  }
}

TEST(AdcInl, IsASineOfTheNumber) {
  const FrameSetup frame = TestFrame();
  Image<double> image(1, 1, 0.25 * 1023 / 0.16);
  image = OnCharge("sensor.adc_inl", {{"inl_amplitude_dn", 3}, {"inl_cycles", 1}}, image, frame);
  EXPECT_NEAR(image.values[0] * 0.16, 0.25 * 1023 + 3, 1e-9);
}

TEST(AdcMissingBits, LowestBitsAreZero) {
  Image<uint16_t> raw(4, 1);
  raw.values = {0, 1023, 517, 6};
  const Effect& effect = TheEffect("sensor.adc_missing_bits");
  effect.OnRaw(raw, TestFrame(), std::vector<double>{2.0});
  EXPECT_EQ(raw.values, (std::vector<uint16_t>{0, 1020, 516, 4}));
}

}  // namespace
}  // namespace sightline
