// SPDX-License-Identifier: Apache-2.0
#include "render_worker/sensor/emva1288_measurement.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/QR>
#include <cmath>
#include <numbers>

#include "render_worker/sensor/characterise_sensor.h"
#include "tests/render_worker/sensor/chi_squared.h"

namespace sightline {
namespace {

using ::testing::HasSubstr;

// 99.9 % of a normal law: one quantity in a thousand misses by chance.
constexpr double kConfidence = 3.29;

Sensor MonoSensor() {
  Sensor sensor;  // Table 5.3, monochrome
  sensor.quantum_efficiency[0] = {{0}, {0.53}};
  sensor.dark_mean_electrons = 60;  // high enough that no dark pixel is cut at zero
  sensor.dark_noise_electrons = 6.5;
  sensor.dark_current_electrons_per_s = 40;
  sensor.dark_current_doubling_k = 7;
  sensor.prnu_relative = 0.01;
  sensor.dsnu_electrons = 5;
  return sensor;
}

void ExpectCovers(const Estimate& estimate, double truth, const char* what) {
  EXPECT_GT(estimate.standard_error, 0) << what;
  EXPECT_LT(std::abs(estimate.value - truth), kConfidence * estimate.standard_error)
      << what << ": " << estimate.value << " +- " << estimate.standard_error << ", true " << truth;
}

// Light at which the variance of min(charge, full) is largest, charge being normal with the
// variance of photons and dark noise: what clause 6.6 calls saturation.
double VarianceMaximumElectrons(double full_electrons, double dark_mean, double dark_noise) {
  double best = 0, best_variance = 0;
  for (double light = 0.8 * full_electrons; light < full_electrons; light += 0.25) {
    const double s = std::sqrt(light + dark_noise * dark_noise);
    const double t = (full_electrons - light - dark_mean) / s;  // distance to the end
    // Moments of min(x, t) of a standard normal x.
    const double density = std::exp(-t * t / 2) / std::sqrt(2 * std::numbers::pi);
    const double above = 0.5 * std::erfc(t / std::numbers::sqrt2);
    const double first = -density + t * above;
    const double second = (1 - above) - t * density + t * t * above;
    const double variance = s * s * (second - first * first);
    if (variance > best_variance) {
      best_variance = variance;
      best = light;
    }
  }
  return best;
}

void ExpectRecovers(const Sensor& sensor, const CharacterisationSetup& setup) {
  const auto measured = CharacteriseSensor(sensor, setup);
  ASSERT_TRUE(measured.ok()) << measured.status();
  const PhotonTransfer& transfer = measured->photon_transfer;
  const double eta = sensor.quantum_efficiency[setup.channel].At(setup.wavelength_m);
  ExpectCovers(transfer.gain_dn_per_electron, sensor.gain_dn_per_electron, "K");
  ExpectCovers(transfer.responsivity_dn_per_photon, eta * sensor.gain_dn_per_electron, "R");
  ExpectCovers(transfer.quantum_efficiency, eta, "QE");
  // Over the millisecond of the exposures the dark current adds next to nothing.
  ExpectCovers(transfer.dark_noise_electrons, sensor.dark_noise_electrons, "dark noise");
  EXPECT_FALSE(transfer.dark_noise_is_upper_bound);
  ExpectCovers(measured->non_uniformity.prnu_relative, sensor.prnu_relative, "PRNU");
  ExpectCovers(measured->non_uniformity.dsnu_electrons, sensor.dsnu_electrons, "DSNU");
  ExpectCovers(measured->dark_current.from_mean_electrons_per_s,
               sensor.dark_current_electrons_per_s, "dark current by mean");
  ExpectCovers(measured->dark_current.from_variance_electrons_per_s,
               sensor.dark_current_electrons_per_s, "dark current by variance");
  ASSERT_TRUE(measured->over_temperature.has_value());
  ExpectCovers(measured->over_temperature->doubling_k, sensor.dark_current_doubling_k, "doubling");
  ExpectCovers(measured->over_temperature->at_reference_electrons_per_s,
               sensor.dark_current_electrons_per_s, "dark current at the reference");

  const double full = ClippingChargeElectrons(sensor);
  const double step = 1.15 * (full - sensor.dark_mean_electrons) / setup.exposure_steps;
  EXPECT_NEAR(
      transfer.saturation_capacity_electrons.value,
      VarianceMaximumElectrons(full, sensor.dark_mean_electrons, sensor.dark_noise_electrons),
      step + kConfidence * full * transfer.quantum_efficiency.standard_error / eta);
  // A linear camera shows the noise of its means only: 55 values, whose mean magnitude scatters by
  // sqrt(pi / 2 - 1) / sqrt(55) = 10 %.
  EXPECT_LT(transfer.linearity_error_relative,
            (1 + kConfidence * 0.1) * transfer.linearity_noise_relative);
  EXPECT_GT(transfer.linearity_error_relative,
            (1 - kConfidence * 0.1) * transfer.linearity_noise_relative);
}

TEST(Emva1288, RecoversTheMonochromeSensor) {
  CharacterisationSetup setup;
  setup.stack_frames = 60;
  ExpectRecovers(MonoSensor(), setup);
}

TEST(Emva1288, RecoversEveryChannelOfTheColourSensor) {
  Sensor sensor = MonoSensor();
  sensor.colour_filter = ColourFilter::kBayerRggb;
  sensor.quantum_efficiency = {{{{0}, {0.48}}, {{0}, {0.09}}, {{0}, {0.03}}}};
  sensor.gain_dn_per_electron = 0.53;
  sensor.saturation_capacity_electrons = 33456;
  sensor.dark_noise_electrons = 3.5;
  for (const int channel : {kRed, kGreen, kBlue}) {
    CharacterisationSetup setup;
    setup.channel = channel;
    setup.seed = 20 + channel;
    setup.size_px = 160;
    setup.stack_frames = 50;
    ExpectRecovers(sensor, setup);
  }
}

TEST(Emva1288, RecoversASensorWhosePixelIsFullBeforeTheConverter) {
  Sensor sensor = MonoSensor();
  sensor.bit_depth_bit = 12;
  sensor.gain_dn_per_electron = 0.3;
  sensor.saturation_capacity_electrons = 9000;
  sensor.black_level_dn = 20;
  CharacterisationSetup setup;
  setup.seed = 5;
  setup.size_px = 200;
  setup.stack_frames = 50;
  ExpectRecovers(sensor, setup);
}

// The intervals themselves: deviations in units of the standard error have the variance 1.
TEST(Emva1288, StandardErrorsAreRight) {
  const Sensor sensor = MonoSensor();
  constexpr int kRuns = 60;
  double squares[7] = {};
  for (int run = 0; run < kRuns; ++run) {
    CharacterisationSetup setup;
    setup.size_px = 64;
    setup.exposure_steps = 24;
    setup.stack_frames = 16;
    setup.seed = 1000 + run;
    const auto measured = CharacteriseSensor(sensor, setup);
    ASSERT_TRUE(measured.ok()) << measured.status();
    const auto z2 = [](const Estimate& e, double truth) {
      return std::pow((e.value - truth) / e.standard_error, 2);
    };
    squares[0] += z2(measured->photon_transfer.gain_dn_per_electron, 0.16);
    squares[1] += z2(measured->photon_transfer.quantum_efficiency, 0.53);
    squares[2] += z2(measured->photon_transfer.dark_noise_electrons, 6.5);
    squares[3] += z2(measured->non_uniformity.prnu_relative, 0.01);
    squares[4] += z2(measured->non_uniformity.dsnu_electrons, 5);
    squares[5] += z2(measured->dark_current.from_mean_electrons_per_s, 40);
    squares[6] += z2(measured->dark_current.from_variance_electrons_per_s, 40);
  }
  for (int i = 0; i < 7; ++i) {
    EXPECT_GT(ChiSquaredTail(squares[i], kRuns), 5e-4) << i << ": " << squares[i] / kRuns;
    EXPECT_LT(ChiSquaredTail(squares[i], kRuns), 1 - 5e-4) << i << ": " << squares[i] / kRuns;
  }
}

TEST(StatisticsOfPair, SeparatesTemporalAndSpatialVariance) {
  Image<uint16_t> a(2, 2), b(2, 2);
  a.values = {10, 20, 30, 40};
  b.values = {12, 18, 32, 38};
  const PairStatistics pair = StatisticsOfPair(a, b);
  EXPECT_DOUBLE_EQ(pair.mean_dn, 25);
  // Differences -2, 2, -2, 2: variance 4 * 4 / 3, half of it.
  EXPECT_DOUBLE_EQ(pair.temporal_variance_dn2, 8.0 / 3);
  // Covariance: (-15 * -13 + -5 * -7 + 5 * 7 + 15 * 13) / 3.
  EXPECT_DOUBLE_EQ(pair.spatial_variance_dn2, 460.0 / 3);
}

TEST(FrameStack, SeparatesTemporalAndSpatialVariance) {
  FrameStack stack;
  Image<uint16_t> frame(2, 1);
  for (const auto& [left, right] : {std::pair(9, 21), std::pair(11, 19), std::pair(10, 20)}) {
    frame.values = {static_cast<uint16_t>(left), static_cast<uint16_t>(right)};
    stack.Add(frame);
  }
  EXPECT_EQ(stack.frames(), 3);
  EXPECT_DOUBLE_EQ(stack.MeanDn(), 15);
  EXPECT_DOUBLE_EQ(stack.TemporalVarianceDn2(), 1);
  EXPECT_DOUBLE_EQ(stack.MeasuredSpatialVarianceDn2(), 50);
}

TEST(ChannelPixels, PicksTheColourWhereverTheRegionStarts) {
  Sensor sensor;
  sensor.colour_filter = ColourFilter::kBayerRggb;
  Image<uint16_t> raw(4, 4);
  const RegionOfInterest roi{-3, -1, 4, 4};
  for (int i = 0; i < 4; ++i) {
    for (int j = 0; j < 4; ++j) {
      raw.At(i, j) = static_cast<uint16_t>(sensor.ChannelAt(roi.row_px + i, roi.column_px + j));
    }
  }
  for (int channel = 0; channel < 3; ++channel) {
    const Image<uint16_t> pixels = ChannelPixels(raw, sensor, roi, channel);
    EXPECT_EQ(pixels.values.size(), channel == kGreen ? 8u : 4u);
    EXPECT_THAT(pixels.values, ::testing::Each(channel));
  }
}

// Statistics of a camera whose response bends: e (1 - bend e / full), without any noise in them.
std::vector<ExposureStep> BendingCamera(double bend) {
  std::vector<ExposureStep> steps;
  for (int i = 1; i <= 60; ++i) {
    ExposureStep step;
    step.photons = 200 * i;
    step.exposure_time_s = 1e-3;
    const double electrons = 0.5 * step.photons * (1 - bend * 0.5 * step.photons / 6000);
    step.bright = {1e4, 10 + 0.2 * electrons, 4 + 0.04 * electrons, 0};
    if (i > 55) step.bright.temporal_variance_dn2 = 0;  // saturated
    step.dark = {1e4, 10, 4, 0};
    steps.push_back(step);
  }
  return steps;
}

TEST(MeasurePhotonTransfer, LinearityErrorIsTheMeanRelativeDeviation) {
  const auto straight = MeasurePhotonTransfer(BendingCamera(0));
  ASSERT_TRUE(straight.ok()) << straight.status();
  EXPECT_LT(straight->linearity_error_relative, 1e-12);
  EXPECT_NEAR(straight->gain_dn_per_electron.value, 0.2, 1e-12);
  EXPECT_NEAR(straight->quantum_efficiency.value, 0.5, 1e-12);
  EXPECT_NEAR(straight->dark_noise_electrons.value, std::sqrt(4 - 1.0 / 12) / 0.2, 1e-9);
  EXPECT_EQ(straight->saturation_photons.value, 11000);

  const std::vector<ExposureStep> steps = BendingCamera(0.05);
  const auto bent = MeasurePhotonTransfer(steps);
  ASSERT_TRUE(bent.ok()) << bent.status();
  // Independent solution: rows (1, photons) / signal, right side 1.
  const double saturation = steps[54].bright.mean_dn - 10;
  std::vector<int> used;
  for (int i = 0; i < 60; ++i) {
    const double y = steps[i].bright.mean_dn - 10;
    if (y >= 0.05 * saturation && y <= 0.95 * saturation) used.push_back(i);
  }
  Eigen::MatrixXd rows(used.size(), 2);
  for (size_t i = 0; i < used.size(); ++i) {
    const double y = steps[used[i]].bright.mean_dn - 10;
    rows(i, 0) = 1 / y;
    rows(i, 1) = steps[used[i]].photons / y;
  }
  const Eigen::Vector2d line = rows.colPivHouseholderQr().solve(Eigen::VectorXd::Ones(used.size()));
  double sum = 0, most = 0, least = 0;
  for (const int i : used) {
    const double fit = line[0] + line[1] * steps[i].photons;
    const double deviation = (steps[i].bright.mean_dn - 10 - fit) / fit;
    sum += std::abs(deviation);
    most = std::max(most, deviation);
    least = std::min(least, deviation);
  }
  EXPECT_GT(sum / used.size(), 1e-3);
  EXPECT_NEAR(bent->linearity_error_relative, sum / used.size(), 1e-9);
  EXPECT_NEAR(bent->linearity_error_max_relative, most, 1e-9);
  EXPECT_NEAR(bent->linearity_error_min_relative, least, 1e-9);
}

TEST(MeasurePhotonTransfer, DarkNoiseBelowQuantisationIsAnUpperBound) {
  std::vector<ExposureStep> steps = BendingCamera(0);
  for (ExposureStep& step : steps) {
    step.dark.temporal_variance_dn2 = 0.1;
    if (step.bright.temporal_variance_dn2 > 0) step.bright.temporal_variance_dn2 -= 3.9;
  }
  const auto transfer = MeasurePhotonTransfer(steps);
  ASSERT_TRUE(transfer.ok()) << transfer.status();
  EXPECT_TRUE(transfer->dark_noise_is_upper_bound);
  EXPECT_NEAR(transfer->dark_noise_electrons.value, 0.396 / 0.2, 1e-3 / 0.2);
}

TEST(MeasurePhotonTransfer, RefusesSeriesItCannotEvaluate) {
  std::vector<ExposureStep> steps = BendingCamera(0);
  const auto error = [](const std::vector<ExposureStep>& s) {
    const auto result = MeasurePhotonTransfer(s);
    EXPECT_EQ(result.status().code(), absl::StatusCode::kInvalidArgument);
    return std::string(result.status().message());
  };
  EXPECT_THAT(error({steps.begin(), steps.begin() + 40}), HasSubstr("beyond saturation"));
  EXPECT_THAT(error({steps.begin(), steps.begin() + 10}), HasSubstr("at least 20"));
  std::swap(steps[3], steps[4]);
  EXPECT_THAT(error(steps), HasSubstr("step 4"));
}

TEST(MeasureDarkCurrent, RefusesTooFewTimesAndTemperatures) {
  const PairStatistics pair{1e4, 10, 2, 0};
  EXPECT_EQ(MeasureDarkCurrent(std::vector<DarkStep>{{1, pair}, {2, pair}, {2, pair}}, {0.2, 0.01})
                .status()
                .code(),
            absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(
      MeasureDoublingTemperature(std::vector<TemperatureStep>{{25, {1, 0.1}}, {30, {2, 0.1}}}, 25)
          .status()
          .code(),
      absl::StatusCode::kInvalidArgument);
  const auto zero = MeasureDoublingTemperature(
      std::vector<TemperatureStep>{{25, {0.1, 0.1}}, {30, {2, 0.1}}, {35, {3, 0.1}}}, 25);
  EXPECT_THAT(std::string(zero.status().message()), HasSubstr("at 25 degrees Celsius"));
}

TEST(MeasureNonUniformity, RefusesStacksThatDoNotMatch) {
  FrameStack one, two, small;
  one.Add(Image<uint16_t>(4, 4, 1));
  two.Add(Image<uint16_t>(4, 4, 9));
  EXPECT_FALSE(MeasureNonUniformity(one, two, {0.2, 0.01}).ok());
  one.Add(Image<uint16_t>(4, 4, 1));
  two.Add(Image<uint16_t>(4, 4, 9));
  EXPECT_TRUE(MeasureNonUniformity(one, two, {0.2, 0.01}).ok());
  EXPECT_FALSE(MeasureNonUniformity(two, one, {0.2, 0.01}).ok());
  small.Add(Image<uint16_t>(2, 2, 9));
  small.Add(Image<uint16_t>(2, 2, 9));
  EXPECT_FALSE(MeasureNonUniformity(one, small, {0.2, 0.01}).ok());
}

}  // namespace
}  // namespace sightline
