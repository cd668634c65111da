// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/selection/screening/screening.h"

#include <gtest/gtest.h>

#include <cmath>
#include <utility>
#include <vector>

#include "core/random/counter_random.h"
#include "tests/render_worker/diagnosis/rendered_set.h"

namespace sightline {
namespace {

// Three dozen recordings at odd times, as they are expected.
RecordedSet Planned() {
  RecordingSet description = SmallSetDescription();
  const std::vector<RecordedImage> once = description.recordings;
  for (int round = 1; round <= 2; ++round) {
    for (RecordedImage image : once) {
      if (image.kind == RecordingKind::kLaser) *image.plate_position_id += 100 * round;
      image.repeat_group += 100 * round;
      description.recordings.push_back(image);
    }
  }
  CounterRandom random(7, 0);
  double time_s = 0;
  for (RecordedImage& image : description.recordings) {
    time_s += 5 + 40 * random.Uniform();
    image.timestamp_s = time_s;
  }
  return MakeRecordedSet(std::move(description), {});
}

// Screened strength of an effect if nothing else is missing, without noise.
std::vector<double> ScreenedFor(const ActiveEffect& truth) {
  const RecordedSet set = Planned();
  const SetModel model(set, {});
  FitResult null = LineariseSet(model, {});
  const Screening expected(model, null);
  const Eigen::VectorXd change = expected.linear().Project(expected.ChangeOf(truth));
  Eigen::Index at = 0;
  for (Eigen::VectorXd& residual : null.residual) {
    residual = change.segment(at, residual.size());
    at += residual.size();
  }
  return Screening(model, null).Screen(*truth.effect).strongest.parameters;
}

// A bug found: recordings are minutes apart, so that a hundredth of a hertz is another frequency,
// and what flickers was taken for smear or glare.
TEST(Screening, FlickerHasItsFrequency) {
  for (const double frequency_hz : {33.3, 67.31, 119.98}) {
    const std::vector<double> found =
        ScreenedFor({FindEffect("time.ambient_flicker"), {1e-3, 0.8, frequency_hz}});
    EXPECT_NEAR(found[2], frequency_hz, 1e-3);
    // From here a fit finds the rest.
    EXPECT_NEAR(found[0], 1e-3, 2e-4);
    EXPECT_NEAR(found[1], 0.8, 0.25);
  }
}

// A bug found: variance grows with the square of the speed, and neither a straight line from where
// it is one nor a large step came near a speed between.
TEST(Screening, SpeedOfThePlateIsFoundBetweenALittleAndALot) {
  const Effect* motion = FindEffect("time.plate_motion");
  for (const double speed_m_s : {1e-7, 3e-7, 1e-6}) {
    const double found = std::abs(ScreenedFor({motion, {speed_m_s}})[0]);
    EXPECT_GT(found, 0.5 * speed_m_s);
    EXPECT_LT(found, 2 * speed_m_s);
  }
}

// A bug found: with the gain held at three standard uncertainties, a gain error beyond it was worth
// next to nothing by itself, and was never fitted.
TEST(Screening, WhatIsHeldAtABoundGivesWayToAnEffect) {
  const RecordedSet set = Planned();
  const SetModel model(set, {});
  FitResult null = LineariseSet(model, {});
  const Effect* gain_error = FindEffect("sensor.gain_error");
  constexpr double kFactor = 1.06;
  SetupDeviation uncertainty = set.description.uncertainty;
  Eigen::VectorXd left;
  int gain = 0;  // index of the known gain
  {
    const Screening expected(model, null);
    left = expected.ChangeOf({gain_error, {kFactor}});
    while (&DeviationAt(null.parameters.deviations, gain) !=
           &null.parameters.deviations.gain_relative) {
      ++gain;
    }
  }
  const double held = 3;
  ASSERT_LT(held * uncertainty.gain_relative, kFactor - 1);
  int column = 0;
  for (int i = 0; i < gain; ++i) column += DeviationAt(uncertainty, i) > 0 ? 1 : 0;
  null.standardised[column] = held;
  null.at_bound.assign(null.standardised.size(), false);
  null.at_bound[column] = true;
  Eigen::Index at = 0;
  for (size_t e = 0; e < null.residual.size(); ++e) {
    const Eigen::Index n = null.residual[e].size();
    null.residual[e] = left.segment(at, n) - held * null.jacobian[e].col(column);
    at += n;
  }
  // The others have made of it what they can.
  const LinearFit bound(null);
  const Eigen::VectorXd at_best = bound.ResidualAtBest(), step = bound.Step();
  at = 0;
  for (Eigen::VectorXd& residual : null.residual) {
    residual = at_best.segment(at, residual.size());
    at += residual.size();
  }
  null.standardised += step;
  const ScreenedEffect found = Screening(model, null).Screen(*gain_error);
  EXPECT_GT(found.linear_gain, 10);
  EXPECT_NEAR(found.linear_best.parameters[0], kFactor, 0.015);
}

// A bug found: a ghost near the line was called a reflection in the lens, which was searched for.
TEST(Screening, GhostLineIsFoundFromWithinItsWidth) {
  for (const double offset_m : {-4.6e-3, -1.06e-3, 1.06e-3, 3.3e-3}) {
    const std::vector<double> found =
        ScreenedFor({FindEffect("illumination.ghost_line"), {1e-3, offset_m}});
    EXPECT_NEAR(found[1], offset_m, 0.2 * std::abs(offset_m));
  }
}

TEST(Screening, WavesOfTheConverterAreFoundFromWithinHalfACycle) {
  for (const double cycles : {1.4, 2.8, 5.5}) {
    const std::vector<double> found = ScreenedFor({FindEffect("sensor.adc_inl"), {1.5, cycles}});
    EXPECT_NEAR(found[1], cycles, 0.5);
  }
}

}  // namespace
}  // namespace sightline
