// SPDX-License-Identifier: Apache-2.0
// Expected frames against averages of simulated ones.
#include "render_worker/diagnosis/expectation/expected_frame.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "render_worker/diagnosis/diagnose.h"
#include "tests/render_worker/diagnosis/rendered_set.h"

namespace sightline {
namespace {

TEST(ExpectFrame, AStuckBitTakesHalfANumberOnAverage) {
  const RecordedSet set = MakeRecordedSet(SmallSetDescription(), {});
  for (size_t f = 0; f < set.frames.size(); ++f) {
    FrameSetup frame = DeviatedFrame(set, static_cast<int>(f), {});
    if (frame.laser_on && frame.shutter_open) continue;
    frame.roi.columns_px = 2;
    // Noise over several numbers, so that even and odd ones are equally likely.
    frame.sensor.dark_noise_electrons = 3 / frame.sensor.gain_dn_per_electron;
    frame.sensor.dark_mean_electrons = 40.3 / frame.sensor.gain_dn_per_electron;
    const std::vector<ActiveEffect> stuck = {{FindEffect("sensor.adc_missing_bits"), {1}}};
    const ExpectedFrame plain = ExpectFrame(frame, {}, nullptr, nullptr, 4);
    const ExpectedFrame expected = ExpectFrame(frame, stuck, nullptr, nullptr, 4);
    EXPECT_NEAR(expected.MeanDn(0, 0) - plain.MeanDn(0, 0), -0.5, 0.05);
    EXPECT_NEAR(expected.noise_variance_dn2.At(0, 0) - plain.noise_variance_dn2.At(0, 0),
                (4.0 - 1.0) / 12, 1e-4);
    return;
  }
  FAIL() << "no dark frame";
}

// Effects on charge act after the noise has been added, so that they scale it as they scale the
// signal. A bug found: a gain that alternates between columns left the noise as it was.
TEST(ExpectFrame, NoiseIsScaledAsTheCharge) {
  const RecordedSet set = MakeRecordedSet(SmallSetDescription(), {});
  const auto dark = std::find_if(set.frames.begin(), set.frames.end(),
                                 [](const RecordedFrame& f) { return f.plate_position_id < 0; });
  FrameSetup frame = dark->nominal;
  frame.roi.columns_px = 2;
  frame.sensor.dark_noise_electrons = 5 / frame.sensor.gain_dn_per_electron;
  const double rounding_dn2 = 1.0 / 12;
  for (const ColourFilter filter : {ColourFilter::kMono, ColourFilter::kBayerRggb}) {
    frame.sensor.colour_filter = filter;
    for (const double difference : {0.1, -0.2}) {
      const std::vector<ActiveEffect> gain = {{FindEffect("sensor.column_gain"), {difference}}};
      const ExpectedFrame expected = ExpectFrame(frame, gain, nullptr, nullptr, 4);
      double noise_dn[2];
      for (int c = 0; c < 2; ++c) {
        noise_dn[c] = std::sqrt(expected.noise_variance_dn2.At(0, c) - rounding_dn2);
      }
      const double ratio = (1 + difference / 2) / (1 - difference / 2);
      const bool first_is_odd = frame.roi.column_px % 2 != 0;
      EXPECT_NEAR(noise_dn[first_is_odd ? 0 : 1] / noise_dn[first_is_odd ? 1 : 0], ratio, 1e-3);
    }
  }
}

// A bug found: a ripple as fine as a block was taken at the block's middle, and its scatter within
// for a pattern of the sensor.
TEST(ExpectFrame, AStripStandsForTheMeanOfItsBlock) {
  const RecordedSet set = MakeRecordedSet(SmallSetDescription(), {});
  const auto lit = std::find_if(set.frames.begin(), set.frames.end(),
                                [](const RecordedFrame& f) { return f.plate_position_id >= 0; });
  FrameSetup frame = lit->nominal;
  constexpr int kBlock_px = 96;
  const double seen_m = kBlock_px * frame.sensor.pixel_pitch_m * frame.plate.camera_distance_m /
                        frame.ImageDistance();
  const double turn_deg = std::atan(seen_m / frame.plate.laser_distance_m) * 180 / std::numbers::pi;
  frame.roi.column_px = -1;
  frame.roi.columns_px = 2;
  const std::vector<ActiveEffect> ripple = {
      {FindEffect("illumination.line_nonuniformity"), {0, 0.3, turn_deg, 0}}};
  const ExpectedFrame even = ExpectFrame(frame, {}, nullptr, nullptr, 4, kBlock_px);
  const ExpectedFrame mean = ExpectFrame(frame, ripple, nullptr, nullptr, 4, kBlock_px);
  const ExpectedFrame middle = ExpectFrame(frame, ripple, nullptr, nullptr, 4);
  const auto light = [&](const ExpectedFrame& expected) {
    double sum = 0;
    for (int row = 0; row < frame.roi.rows_px; ++row)
      sum += expected.mean_photo_electrons.At(row, 0);
    return sum;
  };
  EXPECT_NEAR(light(mean) / light(even), 1, 0.01);
  EXPECT_NEAR(light(middle) / light(even), 1.3, 0.01);
  EXPECT_TRUE(even.level_along_line.empty());
  double variance = 0;
  for (double level : mean.level_along_line) variance += (level - 1) * (level - 1);
  EXPECT_NEAR(variance / static_cast<double>(mean.level_along_line.size()), 0.3 * 0.3 / 2, 1e-3);
}

// A bug found: charge that flows faster than there is any gave speckle more contrast than it can
// have, and its law could not be computed.
// A bug found: light of another wavelength counted as sharp as lamps' even light, and fluorescence
// was called partial coherence.
TEST(ExpectFrame, FluorescenceIsImagedByTheLens) {
  const std::vector<ActiveEffect> effects = {{FindEffect("surface.fluorescence"), {0.5}}};
  const RecordedSet with = RenderSmallSet({}, effects, 7), without = RenderSmallSet({}, {}, 7);
  double seen = 0, expected = 0;  // added to the rows beside the line's crest
  for (size_t f = 0; f < with.frames.size(); ++f) {
    FrameSetup frame = with.frames[f].nominal;
    if (with.frames[f].plate_position_id < 0 || frame.plate.camera_distance_m != 0.33) continue;
    frame.roi.columns_px = 1;
    const ExpectedFrame more = ExpectFrame(frame, effects, nullptr, nullptr, 12);
    const ExpectedFrame less = ExpectFrame(frame, {}, nullptr, nullptr, 12);
    const auto& values = less.mean_dn.values;
    const auto crest =
        static_cast<int>(std::max_element(values.begin(), values.end()) - values.begin());
    for (const int distance : {-7, -6, -5, -4, 4, 5, 6, 7}) {
      const int row = crest + distance, columns = with.frames[f].raw_dn.columns_px;
      expected += more.MeanDn(row, 0) - less.MeanDn(row, 0);
      for (int c = 0; c < columns; ++c) {
        seen += (with.frames[f].raw_dn.At(row, c) - 1.0 * without.frames[f].raw_dn.At(row, c)) /
                columns;
      }
    }
  }
  EXPECT_GT(seen, 1);
  EXPECT_NEAR(expected / seen, 1, 0.1);
}

TEST(ExpectFrame, StrengthsBeyondSenseAreComputed) {
  const RecordedSet set = MakeRecordedSet(SmallSetDescription(), {});
  for (const RecordedFrame& recorded : set.frames) {
    if (recorded.plate_position_id < 0) continue;
    FrameSetup frame = recorded.nominal;
    frame.roi.columns_px = 2;
    for (const ActiveEffect& strongest :
         {ActiveEffect{FindEffect("sensor.brighter_fatter"), {1e-5}},
          ActiveEffect{FindEffect("sensor.crosstalk"), {0.2}}}) {
      const ExpectedFrame expected = ExpectFrame(frame, {&strongest, 1}, nullptr, nullptr, 12);
      for (int row = 0; row < frame.roi.rows_px; ++row) {
        ASSERT_TRUE(std::isfinite(expected.MeanDn(row, 0)));
      }
    }
  }
}

// A bug found: a full well just above the converter's largest number, which cannot be seen, changed
// the mean of full pixels.
TEST(ExpectFrame, AFullWellAboveTheConverterIsNotSeen) {
  RecordingSet description = SmallSetDescription();
  description.camera.saturation_capacity_electrons = 1e6;
  FrameSetup frame = MakeRecordedSet(description, {}).frames.front().nominal;
  frame.exposure_time_s *= 20;
  const Sensor& sensor = frame.sensor;
  const double largest_electrons =
      (sensor.largest_dn() - sensor.black_level_dn) / sensor.gain_dn_per_electron;
  const auto brightest = [&](double full_well_electrons) {
    const std::vector<ActiveEffect> effects = {
        {FindEffect("sensor.lower_full_well"), {full_well_electrons}}};
    const ExpectedFrame expected = ExpectFrame(frame, effects, nullptr, nullptr, 12);
    double largest = 0;
    for (int row = 0; row < frame.roi.rows_px; ++row) {
      largest = std::max(largest, expected.MeanDn(row, 0));
    }
    return largest;
  };
  const double without = brightest(1e6);
  EXPECT_GT(without, 0.9 * sensor.largest_dn());
  EXPECT_NEAR(brightest(1.005 * largest_electrons), without, 1e-3);
  EXPECT_LT(brightest(0.95 * largest_electrons), without - 5);
}

}  // namespace
}  // namespace sightline
