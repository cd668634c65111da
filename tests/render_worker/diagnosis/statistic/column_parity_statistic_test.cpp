// SPDX-License-Identifier: Apache-2.0
// Difference of odd and even columns: sign, size and variance, with and without colours, in regions
// that begin at an odd or at an even column.
#include "render_worker/diagnosis/statistic/column_parity_statistic.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "render_worker/image_chain/form_image.h"
#include "render_worker/recordings/strips.h"
#include "tests/render_worker/diagnosis/rendered_set.h"

namespace sightline {
namespace {

constexpr int kParitySegments = 4, kParityPlaces = 6;
constexpr double kDarkMean_electrons = 10;

// Lines at several places of the plate, in focus and out of focus. Little dark charge, so that the
// contrast of the charge is that of the light.
RecordingSet Lines(bool colour, int first_column_px, int places = kParityPlaces) {
  RecordingSet set = SmallSetDescription();
  set.camera.dark_mean_electrons = kDarkMean_electrons;
  set.camera.dark_noise_electrons = 2;
  if (colour) {
    set.camera.colour_filter = ColourFilter::kBayerRggb;
    set.camera.quantum_efficiency[1] = {{661e-9}, {0.4}};
    set.camera.quantum_efficiency[2] = {{661e-9}, {0.1}};
  }
  RecordedImage image = set.recordings.front();
  set.recordings.clear();
  for (int i = 0; i < places; ++i) {
    image.plate_position_id = i;
    image.repeat_group = i;
    image.timestamp_s = 20.0 * i;
    image.f_number = i % 2 == 0 ? 4 : 5.6;
    image.exposure_time_s = 6e-5 * image.f_number * image.f_number;
    image.camera_distance_m = i % 3 == 0 ? 0.33 : 0.3;
    image.roi_column_px = first_column_px;
    image.roi_row_px = -32;
    image.roi_rows_px = 64;
    set.recordings.push_back(image);
  }
  return set;
}

RecordedSet RenderLines(const RecordingSet& description, uint64_t seed,
                        const std::vector<ActiveEffect>& effects) {
  RecordedSet set = MakeRecordedSet(description, {});
  for (size_t f = 0; f < set.frames.size(); ++f) {
    FrameSetup frame = set.frames[f].nominal;
    frame.seeds = {seed * 1000 + f, seed * 1000 + 500 + f, seed, seed};
    auto formed = RenderPlateFrame(frame, effects, nullptr, 1);
    EXPECT_TRUE(formed.ok()) << formed.status();
    set.frames[f].raw_dn = std::move(formed->raw_dn);
  }
  return set;
}

ExpectedSet ExpectLines(const RecordedSet& set, const std::vector<ActiveEffect>& effects) {
  ExpectedSet expected;
  expected.effects = effects;
  expected.strips.resize(kParitySegments);
  for (int segment = 0; segment < kParitySegments; ++segment) {
    for (const RecordedFrame& recorded : set.frames) {
      FrameSetup frame = recorded.nominal;
      frame.roi = StripRegion(frame.roi, kParitySegments, segment, 2);
      expected.strips[segment].push_back(ExpectFrame(
          frame, effects, nullptr, nullptr, 12, recorded.nominal.roi.columns_px / kParitySegments));
    }
  }
  return expected;
}

std::vector<ActiveEffect> ColumnGainOf(double difference) {
  return {{FindEffect("sensor.column_gain"), {difference}}};
}

TEST(ColumnParityStatistic, ScattersAroundZeroAsItsVarianceSays) {
  double sum = 0, squares = 0, count = 0;
  for (const bool colour : {false, true}) {
    const RecordingSet description = Lines(colour, -96, 2 * kParityPlaces);
    const ExpectedSet expected = ExpectLines(MakeRecordedSet(description, {}), {});
    for (uint64_t seed = 1; seed <= 2; ++seed) {
      const RecordedSet set = RenderLines(description, seed, {});
      const ColumnParityStatistic statistic(set);
      EXPECT_GT(statistic.blocks(), kParityPlaces) << colour;
      for (int block = 0; block < statistic.blocks(); ++block) {
        const double error = std::sqrt(statistic.Covariance(expected, block)(0, 0));
        const double residual =
            statistic.Observed(set, block)[0] - statistic.Expected(expected, block)[0];
        sum += residual / error;
        squares += residual * residual / (error * error);
        ++count;
      }
    }
  }
  EXPECT_LT(std::abs(sum), 4 * std::sqrt(count));
  EXPECT_NEAR(squares / count, 1, 4 * std::sqrt(2 / count));
}

// Both renderings have the same speckle and noise, so that the change is the effect alone.
TEST(ColumnParityStatistic, IsTheDifferenceOfTheGains) {
  constexpr double kDifference = 0.02;
  const std::vector<ActiveEffect> effects = ColumnGainOf(kDifference);
  for (const bool colour : {false, true}) {
    for (const int first_column_px : {-96, -95}) {
      const RecordingSet description = Lines(colour, first_column_px);
      const RecordedSet with = RenderLines(description, 5, effects);
      const RecordedSet without = RenderLines(description, 5, {});
      const ExpectedSet expected = ExpectLines(with, effects), plain = ExpectLines(with, {});
      const ColumnParityStatistic statistic(with);
      ASSERT_GT(statistic.blocks(), kParityPlaces / 2);
      double seen = 0, modelled = 0;
      for (int block = 0; block < statistic.blocks(); ++block) {
        seen += statistic.Observed(with, block)[0] - statistic.Observed(without, block)[0];
        modelled += statistic.Expected(expected, block)[0] - statistic.Expected(plain, block)[0];
      }
      seen /= statistic.blocks();
      modelled /= statistic.blocks();
      // The dark charge has the gain, too, but counts for no signal.
      EXPECT_GT(modelled, 0.98 * kDifference) << colour << " " << first_column_px;
      EXPECT_LT(modelled, 1.15 * kDifference) << colour << " " << first_column_px;
      EXPECT_NEAR(seen, modelled, 0.05 * kDifference) << colour << " " << first_column_px;
    }
  }
}

// Light that grows along the line by half, and gains of known sign: no speckle, no noise.
TEST(ColumnParityStatistic, LightThatChangesSlowlyAlongTheLineCancels) {
  constexpr double kCrest_dn = 400, kSlope = 0.5;
  for (const bool colour : {false, true}) {
    for (const int first_column_px : {-96, -95}) {
      for (const double difference : {0.0, 0.03, -0.03}) {
        const RecordingSet description = Lines(colour, first_column_px, 1);
        RecordedSet set = MakeRecordedSet(description, {});
        RecordedFrame& recorded = set.frames.front();
        const RegionOfInterest& roi = recorded.nominal.roi;
        recorded.raw_dn = Image<uint16_t>(roi.columns_px, roi.rows_px);
        const double dark_dn =
            description.camera.gain_dn_per_electron * description.camera.dark_mean_electrons;
        for (int row = 0; row < roi.rows_px; ++row) {
          const double line = kCrest_dn * std::exp(-0.5 * std::pow((row - 31.3) / 4, 2));
          for (int c = 0; c < roi.columns_px; ++c) {
            const bool odd = std::abs(roi.column_px + c) % 2 == 1;
            const double gain = 1 + (odd ? 0.5 : -0.5) * difference;
            const double along = 1 + kSlope * c / roi.columns_px;
            recorded.raw_dn.At(row, c) =
                static_cast<uint16_t>(std::lround(dark_dn + gain * along * line));
          }
        }
        const ColumnParityStatistic statistic(set);
        ASSERT_EQ(statistic.blocks(), 1);
        EXPECT_NEAR(statistic.Observed(set, 0)[0], difference, 5e-4)
            << colour << " " << first_column_px;
      }
    }
  }
}

// A region repeats the columns of the sensor, wherever it begins.
TEST(ExpectFrame, ColumnsAlternateWithTheSensor) {
  constexpr double kDifference = 0.1;
  const RecordedSet set = MakeRecordedSet(Lines(false, 0, 1), {});
  for (const int first_column_px : {-96, -95, 11}) {
    for (const int columns_px : {1, 2, 3, 8}) {
      FrameSetup frame = set.frames.front().nominal;
      frame.roi.column_px = first_column_px;
      frame.roi.columns_px = columns_px;
      const ExpectedFrame plain = ExpectFrame(frame, {}, nullptr, nullptr, 4);
      const ExpectedFrame with = ExpectFrame(frame, ColumnGainOf(kDifference), nullptr, nullptr, 4);
      EXPECT_EQ(with.frame.roi.column_px, first_column_px);
      ASSERT_EQ(with.mean_dn.columns_px, columns_px);
      const auto crest = std::max_element(plain.mean_dn.values.begin(), plain.mean_dn.values.end());
      const auto row = static_cast<int>((crest - plain.mean_dn.values.begin()) / columns_px);
      for (int c = 0; c < columns_px; ++c) {
        const bool odd = std::abs(first_column_px + c) % 2 == 1;
        EXPECT_NEAR(with.MeanDn(row, c) / plain.MeanDn(row, c),
                    1 + (odd ? 0.5 : -0.5) * kDifference, 0.005)
            << first_column_px << " " << columns_px << " " << c;
      }
    }
  }
}

// A set that is planned only is judged by its expected brightness.
TEST(ColumnParityStatistic, NeedsNoImages) {
  for (const bool colour : {false, true}) {
    const RecordedSet planned = MakeRecordedSet(Lines(colour, -96), {});
    const ExpectedSet expected = ExpectLines(planned, {});
    const ColumnParityStatistic statistic(planned);
    const RecordedSet rendered = RenderLines(Lines(colour, -96), 3, {});
    const ColumnParityStatistic recorded(rendered);
    EXPECT_EQ(statistic.blocks(), kParityPlaces);
    ASSERT_EQ(statistic.blocks(), recorded.blocks());
    for (int block = 0; block < statistic.blocks(); ++block) {
      EXPECT_EQ(statistic.Observed(planned, block).size(), 1);
      const double of_plan = statistic.Covariance(expected, block)(0, 0);
      EXPECT_NEAR(std::sqrt(of_plan / recorded.Covariance(expected, block)(0, 0)), 1, 0.2);
    }
  }
}

// Exposures of one place repeat its speckle, which must count once.
TEST(ColumnParityStatistic, RecordingsOfOneSpeckleCountOnce) {
  RecordingSet description = Lines(false, -96, 4);
  for (RecordedImage& image : description.recordings) {
    image.f_number = 4;
    image.exposure_time_s = 1e-3;
    image.camera_distance_m = 0.33;
  }
  const auto error = [&] {
    const RecordedSet planned = MakeRecordedSet(description, {});
    const ColumnParityStatistic statistic(planned);
    EXPECT_EQ(statistic.blocks(), 4);
    return statistic.Covariance(ExpectLines(planned, {}), 0)(0, 0);
  };
  const double apart = error();
  for (RecordedImage& image : description.recordings) {
    image.plate_position_id = 1;
    image.same_speckle = true;
  }
  const double together = error();
  EXPECT_GT(together, 2 * apart);
  EXPECT_LT(together, 4.001 * apart);
}

}  // namespace
}  // namespace sightline
