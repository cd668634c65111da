// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <random>
#include <set>

#include "core/targets/target_set.h"

namespace sightline {
namespace {

// A bit set and the plain set it stands for.
struct Pair {
  TargetBits bits;
  std::set<size_t> set;
};

Pair RandomPair(size_t size, std::mt19937_64& random) {
  Pair pair{TargetBits(size), {}};
  for (size_t i = 0; i < size; ++i) {
    if (random() % 3 == 0) {
      pair.bits.Set(i);
      pair.set.insert(i);
    }
  }
  return pair;
}

std::set<size_t> ToSet(const TargetBits& bits) {
  std::set<size_t> set;
  for (size_t i = 0; i < bits.size(); ++i) {
    if (bits.Test(i)) set.insert(i);
  }
  return set;
}

TEST(TargetBits, AgreesWithPlainSets) {
  std::mt19937_64 random(1);
  for (size_t size : {0, 1, 7, 63, 64, 65, 128, 1000}) {
    const Pair a = RandomPair(size, random), b = RandomPair(size, random);
    EXPECT_EQ(ToSet(a.bits), a.set);
    EXPECT_EQ(a.bits.Count(), static_cast<int64_t>(a.set.size()));

    std::set<size_t> both, either = a.set, only_a;
    for (size_t i : a.set) (b.set.count(i) ? both : only_a).insert(i);
    either.insert(b.set.begin(), b.set.end());
    EXPECT_EQ(ToSet(TargetBits(a.bits) &= b.bits), both);
    EXPECT_EQ(ToSet(TargetBits(a.bits) |= b.bits), either);
    EXPECT_EQ(ToSet(TargetBits(a.bits).Subtract(b.bits)), only_a);
    EXPECT_EQ(a.bits.CountNotIn(b.bits), static_cast<int64_t>(only_a.size()));
  }
}

TEST(TargetBits, ResetRemovesOneBit) {
  TargetBits bits(130);
  for (size_t i : {0, 63, 64, 129}) bits.Set(i);
  bits.Reset(64);
  EXPECT_EQ(ToSet(bits), (std::set<size_t>{0, 63, 129}));
}

TEST(TargetBits, BytesOnTheWireAreLittleEndianBits) {
  TargetBits bits(20);
  bits.Set(0);
  bits.Set(9);
  bits.Set(19);
  EXPECT_EQ(bits.ToBytes(), std::string("\x01\x02\x08", 3));
}

TEST(TargetBits, BytesRoundTrip) {
  std::mt19937_64 random(2);
  for (size_t size : {0, 1, 8, 9, 64, 65, 777}) {
    const Pair a = RandomPair(size, random);
    const std::string bytes = a.bits.ToBytes();
    EXPECT_EQ(bytes.size(), (size + 7) / 8);
    EXPECT_EQ(TargetBits::FromBytes(size, bytes), a.bits);
  }
}

TEST(TargetBits, ForeignBytesCannotSetBitsBeyondTheEnd) {
  const TargetBits longer = TargetBits::FromBytes(10, std::string(100, '\xff'));
  EXPECT_EQ(longer.Count(), 10);
  const TargetBits shorter = TargetBits::FromBytes(100, std::string(2, '\xff'));
  EXPECT_EQ(shorter.Count(), 16);
  EXPECT_EQ(shorter.size(), 100u);
}

}  // namespace
}  // namespace sightline
