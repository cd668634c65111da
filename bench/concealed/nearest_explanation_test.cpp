// SPDX-License-Identifier: Apache-2.0
#include "bench/concealed/nearest_explanation.h"

#include <gtest/gtest.h>

#include <utility>
#include <vector>

#include "bench/concealed/rig_design.h"
#include "render_worker/image_chain/form_image.h"
#include "render_worker/recordings/plate_frames.h"
#include "render_worker/recordings/recorded_set.h"

namespace sightline::bench {
namespace {

RecordedSet Recorded(const RecordingSet& set) {
  std::vector<Image<uint16_t>> images;
  for (size_t i = 0; i < set.recordings.size(); ++i) {
    auto image = RenderPlateFrame(PlateFrame(set, static_cast<int>(i), {}), {}, nullptr, 2);
    EXPECT_TRUE(image.ok());
    images.push_back(std::move(image->raw_dn));
  }
  return MakeRecordedSet(set, std::move(images));
}

TEST(NearestExplanation, BinsAreThoseOfTheirLimits) {
  EXPECT_EQ(BinOfNats(0), "< 3");
  EXPECT_EQ(BinOfNats(3), "3-10");
  EXPECT_EQ(BinOfNats(10), "3-10");
  EXPECT_EQ(BinOfNats(10.1), "> 10");
}

// Factors that enter as a product cannot be told apart; a detector's odd response can.
TEST(NearestExplanation, FindsWhatIsTheSameAndLeavesWhatIsNot) {
  const RecordingSet description = DrawRig(3, "x", SetSize::kSmall);
  const RecordedSet set = Recorded(description);
  NearestSettings settings;
  settings.refits = 3;
  const ActiveEffect brighter = {FindEffect("illumination.power_error"), {1.5}};
  const Distinguishability same =
      NearestExplanation(set, {brighter}, {}, {"illumination.power_error"}, settings);
  EXPECT_GT(same.gain_nats, 10);
  EXPECT_LT(same.nats(), 1);
  // The truth itself among the others leaves nothing.
  const ActiveEffect dark = {FindEffect("sensor.dark_current"), {3000}};
  const Distinguishability itself = NearestExplanation(set, {dark}, {}, {}, settings);
  const Distinguishability without =
      NearestExplanation(set, {dark}, {}, {"sensor.dark_current"}, settings);
  EXPECT_GT(itself.gain_nats, 10);
  EXPECT_LT(itself.nats(), 1);
  EXPECT_EQ(itself.others.front().effect, dark.effect);
  EXPECT_GT(without.nats(), itself.nats());
  EXPECT_LE(without.nats(), without.gain_nats);
}

}  // namespace
}  // namespace sightline::bench
