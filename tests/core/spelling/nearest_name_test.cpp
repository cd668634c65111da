// SPDX-License-Identifier: Apache-2.0
#include "core/spelling/nearest_name.h"

#include <gtest/gtest.h>

namespace sightline {
namespace {

TEST(NearestName, CountsLettersThatDiffer) {
  EXPECT_EQ(NearestName("scan_stp_m", {"stage_travel_m", "scan_step_m"}), "scan_step_m");
  EXPECT_EQ(NearestName("anything", {}), "");
  // The first of equally near ones.
  EXPECT_EQ(NearestName("ac", {"ab", "ad"}), "ab");
  EXPECT_EQ(LikelyName("dark_noise", {"name", "dark_noise_electrons"}), "dark_noise_electrons");
  EXPECT_EQ(NearestName(std::string(100000, 'x'), {"a", "b"}), "a");
}

TEST(NearestName, LikelyOnlyIfLittleDiffers) {
  EXPECT_EQ(LikelyName("planz", {"render", "plan"}), "plan");
  EXPECT_EQ(LikelyName("zzzz", {"render", "plan"}), "");
  EXPECT_EQ(LikelyName("diagnoze", {"render", "diagnose"}), "diagnose");
}

TEST(NearestName, LooksAtTheBeginningOfAbsurdNames) {
  const std::string tail(10'000'000, 'x');  // NOLINT(bugprone-string-constructor): absurd it is
  EXPECT_EQ(NearestName("camera" + tail, {"camera", "lens"}), "camera");
}

}  // namespace
}  // namespace sightline
