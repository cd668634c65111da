// SPDX-License-Identifier: Apache-2.0
#include "planner_client/command_line/process/progress_line.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace sightline {
namespace {

using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::Not;

TEST(ProgressLine, TellsTheTimeAndTheRestAtTheSameRate) {
  EXPECT_EQ(TimeText(0.6, absl::Seconds(150)), "2m30s so far, about 1m40s left");
  EXPECT_EQ(TimeText(1, absl::Seconds(20)), "20s so far, about 0s left");
  EXPECT_EQ(TimeText(0.6, absl::Seconds(1)), "");
}

TEST(ProgressLine, AStepThatStandsStillIsSeenToTakeLonger) {
  std::string before;
  for (int s = 10; s < 10'000; s = s * 3 / 2) {
    const std::string now = TimeText(0.6, absl::Seconds(s));
    EXPECT_NE(now, before);
    EXPECT_THAT(now, EndsWith(" left"));
    before = now;
  }
}

TEST(ProgressLine, GuessesNothingFromTheBeginning) {
  for (const double fraction : {0.0, 0.01, 0.049}) {
    EXPECT_THAT(TimeText(fraction, absl::Hours(1)), Not(HasSubstr("left")));
  }
  EXPECT_THAT(TimeText(0.5, absl::Seconds(9)), Not(HasSubstr("left")));
}

}  // namespace
}  // namespace sightline
