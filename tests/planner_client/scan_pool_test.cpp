#include "planner_client/strategy/scan_pool.h"

#include <gtest/gtest.h>

#include "planner_client/strategy/cover_bits.h"

namespace sightline {
namespace {

TargetBits Bits(size_t size, std::initializer_list<size_t> set) {
  TargetBits bits(size);
  for (size_t i : set) bits.Set(i);
  return bits;
}

TargetBits RandomBits(size_t size, double density, Random& random) {
  TargetBits bits(size);
  for (size_t i = 0; i < size; ++i) {
    if (random.Uniform() < density) bits.Set(i);
  }
  return bits;
}

TEST(CoverBitsTest, CountsAgreeWithSingleBits) {
  Random random(1);
  for (size_t size : {1u, 63u, 64u, 65u, 1000u}) {
    const TargetBits a = RandomBits(size, 0.4, random), b = RandomBits(size, 0.6, random);
    int64_t both = 0, only = 0;
    for (size_t i = 0; i < size; ++i) {
      both += a.Test(i) && b.Test(i);
      only += a.Test(i) && !b.Test(i);
    }
    EXPECT_EQ(CountInBoth(a, b), both);
    EXPECT_EQ(CountOnlyIn(a, b), only);
  }
}

TEST(ScanPoolTest, UniqueTargetsAreCoveredByOneScanOnly) {
  const std::vector<TargetBits> pool = {Bits(6, {0, 1, 2}), Bits(6, {2, 3}), Bits(6, {3, 4})};
  const auto unique = UniqueTargets(pool, {0, 1, 2}, 6);
  EXPECT_EQ(unique[0], Bits(6, {0, 1}));
  EXPECT_EQ(unique[1], Bits(6, {}));
  EXPECT_EQ(unique[2], Bits(6, {4}));
}

// Two rows of k blocks cover everything; greedy is led astray by sets that take most of both rows
// at once (the classic bad case of greedy set cover, blocks of 2, 4, 8, ... targets per row).
std::vector<TargetBits> ClassicTrap(int blocks, size_t* targets) {
  const size_t row = (size_t{2} << blocks) - 2;
  *targets = 2 * row;
  std::vector<TargetBits> pool(2, TargetBits(*targets));
  for (size_t i = 0; i < row; ++i) {
    pool[0].Set(i);
    pool[1].Set(row + i);
  }
  size_t begin = 0;
  for (int b = 1; b <= blocks; ++b) {
    const size_t length = size_t{1} << b;
    TargetBits set(*targets);
    for (size_t i = begin; i < begin + length; ++i) {
      set.Set(i);
      set.Set(row + i);
    }
    begin += length;
    pool.push_back(set);
  }
  return pool;
}

TEST(ScanPoolTest, LocalSearchReachesTheOptimumWhereGreedyFails) {
  size_t targets = 0;
  const std::vector<TargetBits> pool = ClassicTrap(6, &targets);
  const auto all = static_cast<int64_t>(targets);
  PoolPlan greedy;
  CompleteGreedily(pool, greedy, 100, all, targets);
  EXPECT_EQ(greedy.size(), 6u);

  PoolPlan two;
  CompleteGreedily(pool, two, 2, all, targets);
  EXPECT_LT(CoveredBy(pool, two, targets).Count(), all);
  Random random(1);
  const PoolPlan best =
      ImproveCoverage(pool, two, 0, all, 50, targets, random, [] { return false; });
  EXPECT_EQ(best.size(), 2u);
  EXPECT_EQ(CoveredBy(pool, best, targets).Count(), all);
}

TEST(ScanPoolTest, ImprovementKeepsSizeAndFixedScansAndNeverLoses) {
  Random random(3);
  const size_t targets = 300;
  std::vector<TargetBits> pool;
  for (int i = 0; i < 120; ++i) pool.push_back(RandomBits(targets, 0.15, random));
  PoolPlan plan = {5, 9};
  CompleteGreedily(pool, plan, 7, 300, targets);
  ASSERT_EQ(plan.size(), 7u);
  const PoolPlan better =
      ImproveCoverage(pool, plan, 2, 300, 100, targets, random, [] { return false; });
  ASSERT_EQ(better.size(), 7u);
  EXPECT_EQ(better[0], 5u);
  EXPECT_EQ(better[1], 9u);
  EXPECT_GT(CoveredBy(pool, better, targets).Count(), CoveredBy(pool, plan, targets).Count());
}

}  // namespace
}  // namespace sightline
