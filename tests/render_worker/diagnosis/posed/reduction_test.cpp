// SPDX-License-Identifier: Apache-2.0
// Segments of a tilted plate's line against the tilted plate itself.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/recordings/expected_line.h"
#include "core/recordings/reduction/reduce_posed_plates.h"
#include "core/recordings/reduction/start_from_images.h"
#include "render_worker/diagnosis/expectation/expected_frame.h"
#include "render_worker/recordings/plate_frames.h"
#include "render_worker/recordings/profile_bins.h"
#include "tests/render_worker/diagnosis/posed/posed_set.h"

namespace sightline {
namespace {

struct Profile {
  double sum = 0, centre_px = 0, sigma_px = 0, crest = 0;
};

Profile Describe(const std::vector<double>& values) {
  Profile p;
  for (const double v : values) p.sum += v;
  for (size_t i = 0; i < values.size(); ++i) {
    p.centre_px += static_cast<double>(i) * values[i] / p.sum;
  }
  for (size_t i = 0; i < values.size(); ++i) {
    // Near the line, where its light is: tails of diffraction have no finite variance.
    const double away = static_cast<double>(i) - p.centre_px;
    if (std::abs(away) < 15) p.sigma_px += away * away * values[i] / p.sum;
  }
  p.sigma_px = std::sqrt(p.sigma_px);
  p.crest = *std::max_element(values.begin(), values.end());
  return p;
}

std::vector<double> ColumnMeans(const Image<double>& image) {
  std::vector<double> profile;
  for (int row = 0; row < image.rows_px; ++row) {
    double sum = 0;
    for (int c = 0; c < image.columns_px; ++c) sum += image.At(row, c);
    profile.push_back(sum / image.columns_px);
  }
  return profile;
}

class Reduction : public testing::TestWithParam<bool> {};

TEST_P(Reduction, ExpectsWhatTheTiltedPlateShows) {
  const RecordingSet set = PosedSet({.poses = 6, .along_columns = GetParam()});
  // Numbers fine enough to be means: at most 60 000.
  std::vector<Image<uint16_t>> fine;
  std::vector<double> scale;
  for (size_t i = 0; i < set.recordings.size(); ++i) {
    const Image<double> mean = MeanElectronsOf(set, static_cast<int>(i));
    scale.push_back(60000 /
                    std::max(1e-9, *std::max_element(mean.values.begin(), mean.values.end())));
    Image<uint16_t>& image = fine.emplace_back(mean.columns_px, mean.rows_px);
    for (size_t k = 0; k < mean.values.size(); ++k) {
      image.values[k] = static_cast<uint16_t>(std::lround(scale.back() * mean.values[k]));
    }
  }
  const auto reduced = ReducePosedPlates(set, fine);
  ASSERT_TRUE(reduced.ok()) << reduced.status();
  int compared = 0;
  double worst_sum = 0, worst_centre = 0, worst_sigma = 0, worst_shape = 0, total = 0;
  for (size_t k = 0; k < reduced->set.recordings.size(); ++k) {
    const RecordedImage& image = reduced->set.recordings[k];
    if (image.kind != RecordingKind::kLaser) continue;
    size_t source = 0;
    while (set.recordings[source].file != image.part_of_image->file) ++source;
    Image<double> seen(reduced->raw_dn[k].columns_px, reduced->raw_dn[k].rows_px);
    for (size_t i = 0; i < seen.values.size(); ++i) {
      seen.values[i] = reduced->raw_dn[k].values[i] / scale[source];
    }
    const FrameSetup frame = PlateFrame(reduced->set, static_cast<int>(k), {});
    const ExpectedFrame expected = ExpectFrame(frame, {}, nullptr, nullptr, 1);
    const std::vector<double> a = ColumnMeans(seen);
    const std::vector<double> b = ColumnMeans(expected.mean_photo_electrons);
    const Profile rendered = Describe(a), modelled = Describe(b);
    EXPECT_NEAR(modelled.centre_px, NominalLineRow(frame), 0.1);
    worst_sum = std::max(worst_sum, std::abs(modelled.sum / rendered.sum - 1));
    total += modelled.sum / rendered.sum - 1;
    worst_centre = std::max(worst_centre, std::abs(modelled.centre_px - rendered.centre_px));
    worst_sigma = std::max(worst_sigma, std::abs(modelled.sigma_px / rendered.sigma_px - 1));
    for (size_t i = 0; i < a.size(); ++i) {
      worst_shape = std::max(worst_shape, std::abs(a[i] - b[i]) / rendered.crest);
    }
    ++compared;
  }
  ASSERT_GE(compared, 24);
  EXPECT_LT(worst_sum, 0.005);
  EXPECT_LT(std::abs(total / compared), 0.001);
  EXPECT_LT(worst_centre, 0.02);
  EXPECT_LT(worst_sigma, 0.01);
  EXPECT_LT(worst_shape, 0.01);
}

INSTANTIATE_TEST_SUITE_P(BothWays, Reduction, testing::Bool());

TEST(ReducePosedPlates, KeepsEveryColumnOnceAndSaysWhatItLeavesOut) {
  const RecordingSet set = PosedSet({.poses = 3});
  const auto reduced = ReducePosedPlates(set, {});
  ASSERT_TRUE(reduced.ok()) << reduced.status();
  EXPECT_TRUE(reduced->raw_dn.empty());
  EXPECT_EQ(reduced->set.format_version, 1);
  int columns = 0;
  for (const RecordedImage& image : reduced->set.recordings) {
    if (image.kind != RecordingKind::kLaser) continue;
    EXPECT_LE(image.roi_columns_px, kSegmentPx + 2);
    columns += image.roi_columns_px;
  }
  EXPECT_EQ(columns, 3 * 640);
  // Written in the form of version 3, of the parts of the images.
  const v1::Recordings message = RecordingsToProto(reduced->set);
  EXPECT_EQ(message.format_version(), 3);
  EXPECT_EQ(message.recordings(0).file(), "images/000.png");
  EXPECT_TRUE(message.recordings(0).has_plate_pose());
}

TEST(ReducePosedPlates, RefusesFocalLengthsThatDoNotAgree) {
  RecordingSet set = PosedSet({.poses = 3});
  set.focal_length_m = 0.025;
  const auto reduced = ReducePosedPlates(set, {});
  EXPECT_THAT(std::string(reduced.status().message()),
              testing::HasSubstr("must agree within 10 %"));
}

TEST(StartFromImages, FindsHeightAndWidthOfLinesAndTheirOrderWhereTheyAreClipped) {
  for (const double share : {0.4, 3.0}) {
    const RecordingSet set = PosedSet({.poses = 4, .crest_share = share});
    auto reduced = ReducePosedPlates(set, RenderPosedSet(set, {}, 1));
    ASSERT_TRUE(reduced.ok()) << reduced.status();
    RecordingSet start = reduced->set;
    start.laser.power_w *= 40;
    start.laser.divergence_rad *= 0.2;
    EXPECT_TRUE(StartFromImages(reduced->raw_dn, &start).empty());  // both are stated
    start.uncertainty.power_relative = 3;
    start.uncertainty.divergence_relative = 0.3;
    EXPECT_EQ(StartFromImages(reduced->raw_dn, &start).size(), 2u);
    const auto crest = [](const RecordingSet& s) {
      return ExpectLine(s, s.recordings[1]).CrestDn(s.camera, 0);
    };
    const auto width = [](const RecordingSet& s) {
      return ExpectLine(s, s.recordings[1]).width_px;
    };
    // Dark speckles of a clipped line are not clipped: the mean of a row looks lower than it is.
    EXPECT_NEAR(std::log(crest(start) / crest(reduced->set)), 0, share > 1 ? std::log(3.5) : 0.15)
        << share;
    EXPECT_NEAR(std::log(width(start) / width(reduced->set)), 0, share > 1 ? std::log(1.6) : 0.2)
        << share;
  }
}

}  // namespace
}  // namespace sightline
