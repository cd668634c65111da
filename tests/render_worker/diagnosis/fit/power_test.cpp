// SPDX-License-Identifier: Apache-2.0
// Expected gains of recordings before they are made.
#include "render_worker/diagnosis/fit/power.h"

#include <gtest/gtest.h>

#include <vector>

#include "render_worker/diagnosis/diagnose.h"
#include "tests/render_worker/diagnosis/rendered_set.h"

namespace sightline {
namespace {

TEST(NullInformation, GainGrowsWithTheSquareOfAWeakEffect) {
  const RecordedSet set = MakeRecordedSet(SmallSetDescription(), {});
  const NullInformation information(set, {}, {});
  const auto gain = [&](double dark_current) {
    return information.ExpectedGain(
        {ActiveEffect{FindEffect("sensor.dark_current"), {dark_current}}});
  };
  EXPECT_EQ(gain(0), 0);
  EXPECT_GT(gain(1), 0);
  EXPECT_NEAR(gain(2) / gain(1), 4, 0.1);
  // An effect that a stated uncertainty can absorb is worth less than the same without one.
  EXPECT_LT(
      information.ExpectedGain({ActiveEffect{FindEffect("illumination.power_error"), {1.01}}}),
      information.ExpectedGain({ActiveEffect{FindEffect("illumination.power_error"), {1.10}}}) /
          20);
}

TEST(ExpectedGain, WhatAnotherEffectMakesAsWellIsNotLeft) {
  const RecordedSet set = MakeRecordedSet(SmallSetDescription(), {});
  const NullInformation information(set, {}, {});
  const std::vector<ActiveEffect> albedo = {{FindEffect("surface.albedo_error"), {1.5}}};
  const double gain = information.ExpectedGain(albedo);
  ASSERT_GT(gain, 10);
  EXPECT_LT(information.GainLeft(albedo, {{FindEffect("illumination.power_error"), {1.1}}}),
            0.01 * gain);
  EXPECT_GT(information.GainLeft(albedo, {{FindEffect("sensor.dark_current"), {1}}}), 0.9 * gain);
}

// A bug found: the search for the deviation that does the same stopped where it is far from linear.
TEST(ExpectedGain, NoiseWithinItsUncertaintyCostsItsPriorOnly) {
  constexpr double kUncertainty = 0.2;
  RecordingSet description = SmallSetDescription();
  description.uncertainty.dark_noise_relative = kUncertainty;
  const RecordedSet set = MakeRecordedSet(description, {});
  const NullInformation information(set, {}, {});
  const double gain = information.ExpectedGain(
      {{FindEffect("sensor.read_noise_excess"), {1 + 2.5 * kUncertainty}}});
  EXPECT_GT(gain, 0);
  EXPECT_LT(gain, 0.5 * 2.5 * 2.5);
}

// A bug found: a distance far off leads along a narrow valley, and the search stopped on the way.
TEST(ExpectedGain, DistanceWithinItsUncertaintyCostsItsPriorOnly) {
  RecordingSet description = SmallSetDescription();
  description.uncertainty.camera_distance_m = 1e-2;
  for (RecordedImage& image : description.recordings) image.f_number = 1.4;
  const RecordedSet set = MakeRecordedSet(description, {});
  const NullInformation information(set, {}, {});
  for (const double deviations : {-2.9, -2.0, 2.0, 2.9}) {
    const double shift_m = deviations * set.description.uncertainty.camera_distance_m;
    const double gain =
        information.ExpectedGain({{FindEffect("geometry.camera_distance_error"), {shift_m}}});
    EXPECT_GT(gain, 0) << deviations;
    EXPECT_LT(gain, 0.51 * deviations * deviations) << deviations;
  }
}

}  // namespace
}  // namespace sightline
