// SPDX-License-Identifier: Apache-2.0
// Same seed, same bytes: numbers as an implementation in another language gives them, which agrees
// with the known answers of Random123 (philox4x32-10 of zeros begins with 6627e8d5) and SplitMix64.
#include "core/random/seed.h"

#include <gtest/gtest.h>

#include "core/random/counter_random.h"
#include "core/random/random.h"

namespace sightline {
namespace {

TEST(Seed, NumbersAreThoseOfTheAlgorithms) {
  EXPECT_EQ(SplitMix64(0), 0xe220a8397b1dcdafu);
  EXPECT_EQ(CounterRandom(0, 0).Bits(), 0x6627e8d5u);
  Random random(1);
  EXPECT_EQ(random.Bits(), 0xc5883e370b0926c3u);
  EXPECT_EQ(random.Bits(), 0x021b74b80f71f81cu);
  EXPECT_EQ(random.Bits(), 0x268df06749e5c8ceu);
}

TEST(Seed, EveryPurposeAndEveryStreamHasItsOwn) {
  EXPECT_EQ(DeriveSeed(1, "speckle", 3), 0x9abccf74d793482fu);
  EXPECT_EQ(DeriveSeed(1, "speckle"), 0x2bc76c21c4819af0u);
  EXPECT_EQ(DeriveSeed(1, "noise"), 0x723eaea8d789c902u);
  // A literal 0 is the stream 0, no purpose.
  EXPECT_EQ(DeriveSeed(1, 0), 0xe9fd6049d65af21eu);
  EXPECT_EQ(DeriveSeed(1, uint64_t{2}), 0xaa3ba29f9b54b7c9u);
}

}  // namespace
}  // namespace sightline
