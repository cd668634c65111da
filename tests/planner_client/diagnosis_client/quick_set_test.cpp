// SPDX-License-Identifier: Apache-2.0
#include "planner_client/diagnosis_client/quick_set.h"

#include <gtest/gtest.h>

#include <set>
#include <string>

namespace sightline {
namespace {

v1::Recording* Add(v1::Recordings* set, const std::string& kind, int position, int burst = 0) {
  v1::Recording* recording = set->add_recordings();
  recording->set_kind(kind);
  recording->set_plate_position_id(position);
  recording->set_burst_frame_index(burst);
  return recording;
}

TEST(QuickChoice, TakesSomeOfEveryKindAndNoLaterFramesOfBursts) {
  v1::Recordings set;
  set.set_format_version(1);
  for (int i = 0; i < 5; ++i) Add(&set, "dark", -1);
  for (int i = 0; i < 40; ++i) Add(&set, "laser", i / 4, i % 2);
  for (int i = 0; i < 3; ++i) Add(&set, "ambient", -1);
  const std::vector<int> chosen = QuickChoice(set);
  EXPECT_EQ(chosen.size(), 16u);
  EXPECT_TRUE(std::is_sorted(chosen.begin(), chosen.end()));
  EXPECT_EQ(std::set<int>(chosen.begin(), chosen.end()).size(), chosen.size());
  EXPECT_EQ(chosen.front(), 0);
  EXPECT_EQ(chosen.back(), 47);
  for (const int i : chosen) EXPECT_EQ(set.recordings(i).burst_frame_index(), 0);
}

TEST(QuickChoice, HasFourPositionsWhereThereAreAsMany) {
  v1::Recordings set;
  set.set_format_version(1);
  for (int i = 0; i < 60; ++i) Add(&set, "laser", 0);
  for (int i = 1; i < 5; ++i) Add(&set, "laser", i);
  for (int i = 0; i < 60; ++i) Add(&set, "laser", 5);
  std::set<int> positions;
  for (const int i : QuickChoice(set)) positions.insert(set.recordings(i).plate_position_id());
  EXPECT_GE(positions.size(), 4u);
}

TEST(QuickChoice, TakesAllOfFew) {
  v1::Recordings set;
  set.set_format_version(1);
  for (int i = 0; i < 4; ++i) Add(&set, "laser", i);
  EXPECT_EQ(QuickChoice(set), (std::vector<int>{0, 1, 2, 3}));
  set.set_format_version(2);
  EXPECT_EQ(QuickChoice(set).size(), 3u);
}

}  // namespace
}  // namespace sightline
