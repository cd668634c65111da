// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/selection/evident_effects.h"

#include <gtest/gtest.h>

#include <array>
#include <vector>

namespace sightline {
namespace {

// A ramp of `count` numbers, `step` apart from `first`.
RecordedSet Ramp(int first, int step, int count) {
  RecordedSet set;
  RecordedFrame frame;
  frame.raw_dn = Image<uint16_t>(count, 1);
  for (int i = 0; i < count; ++i) {
    frame.raw_dn.At(0, i) = static_cast<uint16_t>(first + step * i);
  }
  set.frames.push_back(frame);
  return set;
}

TEST(EvidentEffects, NumbersThatAreAllMultiplesOfEightLackThreeBits) {
  const std::vector<ActiveEffect> evident = EvidentEffects(Ramp(64, 8, 40), AllEffects());
  ASSERT_EQ(evident.size(), 1U);
  EXPECT_EQ(evident[0].effect, FindEffect("sensor.adc_missing_bits"));
  EXPECT_EQ(evident[0].parameters, std::vector<double>{3});
}

TEST(EvidentEffects, OneOddNumberRefutesThem) {
  RecordedSet set = Ramp(64, 8, 40);
  set.frames[0].raw_dn.At(0, 7) += 1;
  EXPECT_TRUE(EvidentEffects(set, AllEffects()).empty());
}

TEST(EvidentEffects, FewNumbersShowNothing) {
  EXPECT_TRUE(EvidentEffects(Ramp(64, 8, 15), AllEffects()).empty());
  EXPECT_TRUE(EvidentEffects(RecordedSet(), AllEffects()).empty());
}

TEST(EvidentEffects, WhatIsNotConsideredIsNotEvident) {
  const std::array<const Effect*, 1> others = {FindEffect("sensor.adc_inl")};
  EXPECT_TRUE(EvidentEffects(Ramp(64, 8, 40), others).empty());
}

}  // namespace
}  // namespace sightline
