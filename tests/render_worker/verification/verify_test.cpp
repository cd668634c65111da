// SPDX-License-Identifier: Apache-2.0
// Chapter 5 of the thesis on images whose errors are known.
#include "render_worker/verification/verify.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "absl/status/status.h"
#include "render_worker/verification/line_statistics.h"
#include "tests/render_worker/verification/small_set.h"

namespace sightline {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;

constexpr uint64_t kSeed = 4;

// The first laser recordings of the small set alone: they are quick to simulate.
RecordingSet FewRecordings(ColourFilter filter) {
  RecordingSet set = SmallSet(filter);
  set.recordings.resize(7);
  return set;
}

v1::Verification VerifyWith(const RecordingSet& set, std::vector<Image<uint16_t>> images,
                            uint64_t seed, int threads = 2) {
  VerificationSettings settings;
  settings.seed = seed;
  settings.threads = threads;
  auto verification = Verify(MakeRecordedSet(set, std::move(images)), settings, {});
  EXPECT_TRUE(verification.ok()) << verification.status();
  return *std::move(verification);
}

// The same seed makes the same speckle and noise: nothing differs.
TEST(Verify, ImagesOfTheModelItselfHaveNoError) {
  for (const ColourFilter filter : {ColourFilter::kMono, ColourFilter::kBayerRggb}) {
    const RecordingSet set = FewRecordings(filter);
    const v1::Verification verification = VerifyWith(set, RenderSet(set, kSeed), kSeed);
    ASSERT_EQ(verification.recordings_size(), 6);  // the dark frame is no line
    for (const v1::RecordingVerification& recording : verification.recordings()) {
      EXPECT_EQ(recording.recorded_crop_png(), recording.simulated_crop_png());
      EXPECT_THAT(recording.recorded_crop_png(), testing::StartsWith("\x89PNG"));
      const RecordedImage& image = set.recordings[recording.recording()];
      EXPECT_EQ(recording.file(), image.file);
      EXPECT_DOUBLE_EQ(recording.normalised_exposure(),
                       image.exposure_time_s * std::pow(22 / image.f_number, 2));
      for (const v1::ChannelVerification& channel : recording.channels()) {
        EXPECT_EQ(channel.e_i(), 0);
        EXPECT_EQ(channel.recorded_u_px(), channel.simulated_u_px());
        if (channel.has_e_u()) {
          EXPECT_EQ(channel.e_u(), 0);
        }
      }
    }
    EXPECT_EQ(verification.summary_size(), filter == ColourFilter::kMono ? 1 : 3);
    EXPECT_EQ(verification.summary(0).mean_e_i(), 0);
    EXPECT_EQ(verification.summary(0).recordings_e_u(), 6);
  }
}

// Less light with the same speckle: the peak above the dark level shrinks as the power does.
TEST(Verify, IntensityErrorIsThatOfThePower) {
  RecordingSet set = FewRecordings(ColourFilter::kMono);
  set.laser.power_w /= 4;  // no speckle is cut off
  SetupDeviation deviation;
  deviation.power_relative = -0.2;
  const v1::Verification verification =
      VerifyWith(set, RenderSet(set, kSeed, {}, deviation), kSeed);
  const double dark_dn = set.camera.gain_dn_per_electron * set.camera.dark_mean_electrons;
  for (const int i : {0, 5}) {  // f/5.6, f/16: neither saturates nor is dark
    const v1::ChannelVerification& channel = verification.recordings(i).channels(0);
    const double simulated =
        *std::max_element(channel.simulated_dn().begin(), channel.simulated_dn().end());
    const double recorded = 0.8 * (simulated - dark_dn) + dark_dn;
    // A mean of 128 pixels of some 300 DN has photon noise of 0.2 %; twice that, four times.
    EXPECT_NEAR(channel.e_i(), (recorded - simulated) / recorded, 0.012) << i;
  }
}

// Another seed is another speckle: errors scatter about 0.
TEST(Verify, ErrorsOfTheTrueModelScatterAboutZero) {
  RecordingSet set = FewRecordings(ColourFilter::kMono);
  set.recordings.resize(1);
  for (int i = 1; i < 12; ++i) {
    RecordedImage image = set.recordings[0];
    image.file = "images/" + std::to_string(i) + ".png";
    image.plate_position_id = 100 + i;
    set.recordings.push_back(image);
  }
  const v1::Verification verification = VerifyWith(set, RenderSet(set, kSeed + 1), kSeed);
  const v1::ChannelSummary& summary = verification.summary(0);
  ASSERT_EQ(summary.recordings_e_u(), 12);
  // Standard error of a mean of 12, four of them.
  EXPECT_NEAR(summary.mean_e_i(), 0, 4 * summary.deviation_e_i() / std::sqrt(12));
  EXPECT_NEAR(summary.mean_e_u(), 0, 4 * summary.deviation_e_u() / std::sqrt(12));
  EXPECT_GT(summary.deviation_e_i(), 0);
  EXPECT_LT(summary.deviation_e_i(), 0.2);
}

// Worse aim: a blurred line of the same energy is found less well, and its peak is lower.
TEST(Verify, DefocusShows) {
  RecordingSet set = FewRecordings(ColourFilter::kMono);
  set.laser.power_w /= 4;
  SetupDeviation deviation;
  deviation.focus_distance_relative = 0.5;
  const v1::Verification verification =
      VerifyWith(set, RenderSet(set, kSeed + 1, {}, deviation), kSeed);
  EXPECT_LT(verification.recordings(0).channels(0).e_i(), -0.2);
  EXPECT_GT(verification.recordings(0).channels(0).e_u(), 0.1);
}

TEST(Verify, RecordingsWithoutALineAreSaid) {
  const RecordingSet set = FewRecordings(ColourFilter::kMono);
  std::vector<Image<uint16_t>> images = RenderSet(set, kSeed);
  images[0] = images[1];  // a dark frame
  const v1::Verification verification = VerifyWith(set, images, kSeed);
  const v1::ChannelVerification& channel = verification.recordings(0).channels(0);
  EXPECT_LT(channel.recorded_found_fraction(), 0.05);
  EXPECT_GT(channel.simulated_found_fraction(), 0.95);
  EXPECT_FALSE(channel.has_recorded_u_px());
  EXPECT_FALSE(channel.has_recorded_u_h_m());
  EXPECT_FALSE(channel.has_e_u());
  EXPECT_TRUE(channel.has_simulated_u_px());
  EXPECT_THAT(verification.warnings(),
              Contains(AllOf(HasSubstr("images/000.png"), HasSubstr("no line"))));
}

TEST(Verify, SameBytesForAnyNumberOfThreads) {
  const RecordingSet set = FewRecordings(ColourFilter::kMono);
  const std::vector<Image<uint16_t>> images = RenderSet(set, kSeed);
  EXPECT_EQ(VerifyWith(set, images, 9, 1).SerializeAsString(),
            VerifyWith(set, images, 9, 3).SerializeAsString());
}

TEST(Verify, StopsWhenAskedAndTellsProgress) {
  const RecordingSet set = FewRecordings(ColourFilter::kMono);
  const RecordedSet recorded = MakeRecordedSet(set, RenderSet(set, kSeed));
  EXPECT_TRUE(absl::IsCancelled(
      Verify(recorded, {}, [](double, std::string_view) { return false; }).status()));
  double last = -1;
  ASSERT_TRUE(Verify(recorded, {}, [&](double fraction, std::string_view) {
                EXPECT_GE(fraction, last);
                EXPECT_LE(fraction, 1);
                last = fraction;
                return true;
              }).ok());
  EXPECT_GE(last, 0);
}

TEST(Verify, NeedsLaserRecordingsWithImages) {
  RecordingSet set = FewRecordings(ColourFilter::kMono);
  EXPECT_TRUE(absl::IsFailedPrecondition(Verify(MakeRecordedSet(set, {}), {}, {}).status()));
  std::vector<Image<uint16_t>> images = {Image<uint16_t>(128, 96)};
  set.recordings = {set.recordings[1]};
  EXPECT_TRUE(absl::IsFailedPrecondition(Verify(MakeRecordedSet(set, images), {}, {}).status()));
}

// A Gaussian line that sways along the columns.
Image<uint16_t> SwayingLine(double amplitude_px, double sigma_px) {
  Image<uint16_t> image(256, 96);
  for (int column = 0; column < 256; ++column) {
    const double centre = 47.3 + amplitude_px * std::sin(2 * std::numbers::pi * column * 4 / 256);
    for (int row = 0; row < 96; ++row) {
      const double x = (row - centre) / sigma_px;
      image.At(row, column) = static_cast<uint16_t>(std::lround(40 + 20000 * std::exp(-x * x / 2)));
    }
  }
  return image;
}

TEST(LineScatterOfAnImage, IsTheLinesOwn) {
  RecordingSet mono = SmallSet(ColourFilter::kMono), bayer = SmallSet(ColourFilter::kBayerRggb);
  for (RecordingSet* set : {&mono, &bayer}) {
    set->camera.bit_depth_bit = 16;
    const RecordedSet recorded = MakeRecordedSet(*set, {});
    const FrameSetup& frame = recorded.frames[0].nominal;
    const Image<uint16_t> image = SwayingLine(0.8, 2.5);
    for (const ColourChannel& channel : ColourChannels(set->camera)) {
      const auto scatter = DetectLineScatter(image, channel, frame);
      ASSERT_TRUE(scatter.ok()) << scatter.status();
      EXPECT_EQ(scatter->found_fraction, 1) << channel.name;
      EXPECT_NEAR(scatter->mean_row_px, 47.3, 0.02) << channel.name;
      // Standard deviation of a sine over whole periods.
      EXPECT_NEAR(scatter->u_px, 0.8 / std::sqrt(2), 0.01) << channel.name;
    }
  }
}

TEST(LineScatterOfAnImage, HeightByEquation59) {
  FrameSetup frame;
  frame.sensor.pixel_pitch_m = 5e-6;
  frame.lens.focal_length_m = 0.016;
  frame.lens.focus_distance_m = 0.4;
  frame.plate.camera_distance_m = 0.4;
  const double b = 1 / (1 / 0.016 - 1 / 0.4);
  frame.plate.incidence_angle_rad = std::numbers::pi / 4;
  EXPECT_NEAR(HeightUncertainty(0.5, frame), 0.5 * 5e-6 * 0.4 / b, 1e-12);
  frame.plate.incidence_angle_rad = std::numbers::pi / 3;
  EXPECT_NEAR(HeightUncertainty(0.5, frame), 0.5 * 5e-6 * 0.4 / b / std::sqrt(3), 1e-12);
}

TEST(AverageAlongTheLine, KeepsColoursApart) {
  Image<uint16_t> image(6, 4);
  for (int row = 0; row < 4; ++row) {
    for (int column = 0; column < 6; ++column) {
      image.At(row, column) = static_cast<uint16_t>(row % 2 == 0 ? (column % 2 == 0 ? 100 : 10)
                                                                 : (column % 2 == 0 ? 30 : 1)) +
                              row;
    }
  }
  Sensor sensor;
  sensor.colour_filter = ColourFilter::kBayerRggb;
  const std::vector<ColourChannel> channels = ColourChannels(sensor);
  ASSERT_EQ(channels.size(), 3u);
  const AverageProfile red = AverageAlongLine(image, channels[kRed]);
  EXPECT_EQ(red.row_px, (std::vector<int>{0, 2}));
  EXPECT_EQ(red.mean_dn, (std::vector<double>{100, 102}));
  const AverageProfile green = AverageAlongLine(image, channels[kGreen]);
  EXPECT_EQ(green.mean_dn, (std::vector<double>{10, 31, 12, 33}));
  EXPECT_EQ(AverageAlongLine(image, channels[kBlue]).mean_dn, (std::vector<double>{2, 4}));
  EXPECT_EQ(green.Peak(), 33);
}

}  // namespace
}  // namespace sightline
