// SPDX-License-Identifier: Apache-2.0
// Random amplitudes do not follow the set-up, and amplitudes that follow it are not random.
#include "render_worker/diagnosis/random_effect/setup_independence.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "core/random/counter_random.h"
#include "tests/render_worker/diagnosis/rendered_set.h"

namespace sightline {
namespace {

std::vector<double> DrawPerPosition(const RecordedSet& set, uint64_t seed) {
  std::vector<double> drawn;
  for (const RecordedFrame& frame : set.frames) {
    const auto id = static_cast<uint64_t>(frame.plate_position_id + 1);
    drawn.push_back(0.1 * CounterRandom(seed, id).Normal());
  }
  return drawn;
}

TEST(SetupIndependence, PValuesOfChanceAreEven) {
  const RecordedSet set = MakeRecordedSet(SmallSetDescription(), {});
  int below_tenth = 0, below_half = 0;
  constexpr int kTrials = 100;
  for (uint64_t seed = 1; seed <= kTrials; ++seed) {
    const double p = SetupIndependencePValue(set, DrawPerPosition(set, seed), 1);
    EXPECT_GT(p, 0);
    EXPECT_LE(p, 1);
    below_tenth += p < 0.1;
    below_half += p < 0.5;
  }
  // Binomial: 10 +- 3 and 50 +- 5; four standard deviations.
  EXPECT_NEAR(below_tenth, 10, 12);
  EXPECT_NEAR(below_half, 50, 20);
}

TEST(SetupIndependence, LightThatFollowsTheApertureIsNotChance) {
  RecordingSet description = SmallSetDescription();
  // Every second position at another f-number.
  for (auto& recording : description.recordings) {
    if (!recording.plate_position_id) continue;
    recording.f_number = *recording.plate_position_id % 2 == 0 ? 1.4 : 8;
  }
  const RecordedSet set = MakeRecordedSet(description, {});
  std::vector<double> drawn = DrawPerPosition(set, 3);
  for (size_t f = 0; f < drawn.size(); ++f) {
    if (set.frames[f].nominal.lens.f_number < 2) drawn[f] -= 0.5;
  }
  EXPECT_LT(SetupIndependencePValue(set, drawn, 1), 0.02);
}

TEST(SetupIndependence, SameSeedSameAnswer) {
  const RecordedSet set = MakeRecordedSet(SmallSetDescription(), {});
  const std::vector<double> drawn = DrawPerPosition(set, 5);
  EXPECT_EQ(SetupIndependencePValue(set, drawn, 9), SetupIndependencePValue(set, drawn, 9));
}

}  // namespace
}  // namespace sightline
