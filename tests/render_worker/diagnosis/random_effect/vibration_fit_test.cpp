// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/random_effect/vibration_fit.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "core/random/counter_random.h"

namespace sightline {
namespace {

constexpr double kTurn = 2 * std::numbers::pi;

struct Moments {
  double mean, variance;
};

// By summing up the displacements themselves.
Moments OfDisplacements(double amplitude, double frequency_hz, double exposure_s, double phase) {
  constexpr int kMoments = 20000;
  double sum = 0, square = 0;
  for (int k = 0; k < kMoments; ++k) {
    const double t = exposure_s * (k + 0.5) / kMoments;
    const double x = amplitude * std::sin(kTurn * frequency_hz * t + phase);
    sum += x / kMoments;
    square += x * x / kMoments;
  }
  return {sum, square - sum * sum};
}

TEST(VibrationFit, BlurFollowsFromTheMeanDisplacement) {
  for (const double exposure_s : {1e-4, 1e-3, 2.3e-3, 7e-3, 0.31}) {
    for (const double phase : {0.0, 0.4, 1.3, 2.9, 5.0}) {
      const Moments moments = OfDisplacements(1.7, 240, exposure_s, phase);
      EXPECT_NEAR(BlurByVibration(1.7, 240, exposure_s, moments.mean), moments.variance, 1e-5)
          << exposure_s << " s, phase " << phase;
    }
  }
}

std::vector<RecordedMovement> Vibrating(double amplitude, double frequency_hz, double noise,
                                        uint64_t seed) {
  CounterRandom random(seed, 0);
  std::vector<RecordedMovement> movements;
  for (int i = 0; i < 36; ++i) {
    const double exposure_s = 2e-4 * std::pow(10, 0.07 * i);
    const Moments moments =
        OfDisplacements(amplitude, frequency_hz, exposure_s, kTurn * random.Uniform());
    movements.push_back({.exposure_time_s = exposure_s,
                         .shift_px = -1.3 + moments.mean + noise * random.Normal(),
                         .shift_error_px = noise,
                         .blur_px2 = std::max(0.0, moments.variance + noise * random.Normal()),
                         .blur_error_px2 = noise});
  }
  return movements;
}

TEST(VibrationFit, FindsAmplitudeAndFrequency) {
  int within_three_errors = 0;
  for (uint64_t seed = 1; seed <= 6; ++seed) {
    const VibrationFit fit = FitVibration(Vibrating(2.1, 245, 0.1, seed));
    EXPECT_NEAR(fit.amplitude_px, 2.1, 0.1);
    EXPECT_NEAR(fit.frequency_hz, 245, 25);
    within_three_errors += std::abs(fit.amplitude_px - 2.1) < 3 * fit.amplitude_error_px &&
                           std::abs(fit.frequency_hz - 245) < 3 * fit.frequency_error_hz;
  }
  EXPECT_GE(within_three_errors, 5);
}

// Without known positions the blurs alone determine the distribution.
TEST(VibrationFit, NeedsNoPlace) {
  std::vector<RecordedMovement> movements = Vibrating(2.1, 245, 0.1, 9);
  CounterRandom random(10, 0);
  for (RecordedMovement& movement : movements) {
    movement.shift_px += 3 * random.Normal();
    movement.shift_error_px = 3;
  }
  const VibrationFit fit = FitVibration(movements);
  EXPECT_NEAR(fit.amplitude_px, 2.1, 0.15);
  EXPECT_NEAR(fit.frequency_hz, 245, 25);
}

TEST(VibrationFit, OneRecordingThatFollowsNoLawDoesNotSpoilIt) {
  std::vector<RecordedMovement> movements = Vibrating(2.1, 245, 0.1, 3);
  movements[30].blur_px2 = 9;
  const VibrationFit fit = FitVibration(movements);
  EXPECT_NEAR(fit.amplitude_px, 2.1, 0.1);
  EXPECT_NEAR(fit.frequency_hz, 245, 12);
}

TEST(VibrationFit, WeakMovementIsNotSeenInSingleRecordings) {
  EXPECT_TRUE(IsSeenInSingleRecordings(Vibrating(2.1, 245, 0.1, 4)));
  EXPECT_FALSE(IsSeenInSingleRecordings(Vibrating(0.1, 245, 0.1, 4)));
}

}  // namespace
}  // namespace sightline
