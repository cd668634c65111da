// SPDX-License-Identifier: Apache-2.0
#include "planning/strategy/pool/scan_pool.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "planning/strategy/cover_bits.h"

namespace sightline {
namespace {

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

ScanPool PoolOf(const std::vector<TargetBits>& sets, size_t targets) {
  std::vector<uint32_t> all(targets);
  std::iota(all.begin(), all.end(), 0u);
  ScanPool pool({{1.0, {1.0f}}}, all);
  for (const TargetBits& set : sets) pool.Add(FullShares(set));
  return pool;
}

TEST(ScanPoolTest, LooksAtAllTargetsOrAtARandomPart) {
  Random random(2);
  TargetBits few(300), many(20000);
  for (size_t t = 0; t < 300; t += 3) few.Set(t);
  for (size_t t = 0; t < 20000; t += 2) many.Set(t);
  EXPECT_EQ(TargetSample(few, 2, 4096, random), FullShares(few).targets);
  const std::vector<uint32_t> part = TargetSample(many, 2, 4096, random);
  EXPECT_EQ(part.size(), 2048u);
  EXPECT_TRUE(std::is_sorted(part.begin(), part.end()));
  EXPECT_EQ(std::adjacent_find(part.begin(), part.end()), part.end());
  for (const uint32_t t : part) EXPECT_TRUE(many.Test(t));
  // From everywhere: the middle one lies in the middle.
  EXPECT_NEAR(part[1024], 10000, 1000);
}

TEST(ScanPoolTest, WorthCountsTargetsWhoseSharesAddUpToOne) {
  // Steps at a half and at the whole, the latter worth three.
  ScanPool pool({{1.0, {0.5f}}, {3.0, {1.0f}}}, {0, 1, 3});
  pool.Add({{0, 1, 2}, {1.0f, 0.5f, 1.0f}});
  pool.Add({{1, 3}, {0.5f, 0.25f}});
  pool.Add({{3}, {0.999f}});
  EXPECT_DOUBLE_EQ(pool.Worth({}), 0);
  EXPECT_DOUBLE_EQ(pool.Worth({0}), 4 + 1);     // target 2 is not looked at
  EXPECT_DOUBLE_EQ(pool.Worth({1}), 1);         // half of target 1
  EXPECT_DOUBLE_EQ(pool.Worth({0, 1}), 4 + 4);  // two halves of target 1
  EXPECT_DOUBLE_EQ(pool.Worth({2}), 1);         // nearly all of target 3 is not all
  EXPECT_DOUBLE_EQ(pool.Worth({0, 1, 2}), 12);
  EXPECT_DOUBLE_EQ(pool.MostWorth(), 12);
  for (const PoolPlan& plan : {PoolPlan{}, PoolPlan{1}, PoolPlan{0, 2}}) {
    const std::vector<double> with = pool.WorthWithEach(plan);
    ASSERT_EQ(with.size(), 3u);
    for (size_t scan = 0; scan < 3; ++scan) {
      PoolPlan longer = plan;
      longer.push_back(scan);
      EXPECT_DOUBLE_EQ(with[scan], pool.Worth(longer));
    }
  }
  pool.Empty(0);
  EXPECT_DOUBLE_EQ(pool.Worth({0}), 0);
  pool.Keep({1, 2});
  EXPECT_DOUBLE_EQ(pool.Worth({0, 1}), 1 + 4);
}

TEST(ScanPoolTest, WorthAgreesWithSharesUpToTheirRounding) {
  Random random(5);
  const size_t targets = 1000;
  std::vector<uint32_t> all(targets);
  std::iota(all.begin(), all.end(), 0u);
  const std::vector<ShareStep> steps = {{1.0, {1.0f}}, {0.5, {0.5f}}};
  ScanPool pool(steps, all);
  TargetBits measurable(targets);
  for (size_t t = 0; t < targets; ++t) measurable.Set(t);
  std::vector<float> known(targets, 0);
  double gains = 0;
  PoolPlan plan;
  for (int scan = 0; scan < 6; ++scan) {
    TargetShares shares;
    for (size_t t = 0; t < targets; ++t) {
      if (random.Uniform() < 0.5) continue;
      shares.targets.push_back(static_cast<uint32_t>(t));
      shares.share.push_back(static_cast<float>(0.05 + random.Uniform()));
    }
    plan.push_back(pool.Add(shares));
    gains += StepGain(steps, measurable, known, shares);
    AddShares(shares, known);
    EXPECT_NEAR(gains, StepWorth(steps, measurable, known), 1e-6);
  }
  // A share is rounded to 1/127, so that few sums of six near a step are counted otherwise.
  EXPECT_NEAR(pool.Worth(plan), StepWorth(steps, measurable, known), 0.02 * targets);
}

// By sums of shares and by bits a plan is worth the same, before and after exchanges, with every
// scan of the pool in every place; and both are what the pool says.
TEST(ExchangesTest, BitsAndSharesAgree) {
  Random random(7);
  for (const size_t targets : {1u, 64u, 1000u}) {
    std::vector<uint32_t> all(targets);
    std::iota(all.begin(), all.end(), 0u);
    const std::vector<ShareStep> steps = {{1.0, {1.0f}}, {0.25, {0.5f}}};
    ScanPool pool(steps, all);
    std::vector<ShareColumn> columns;
    std::vector<CoverColumn> covers;
    for (int scan = 0; scan < 12; ++scan) {
      const TargetBits set = RandomBits(targets, 0.2, random);
      pool.Add(FullShares(set));
      ShareColumn& column = columns.emplace_back(2 * targets, 0);
      for (size_t t = 0; t < targets; ++t) {
        if (set.Test(t)) column[t] = column[targets + t] = kWholeShare;
      }
      covers.push_back(WholeShares(column, 2, targets));
    }
    // One scan stands twice in it.
    ShareExchanges shares(steps, targets, columns, {0, 3, 3, 5});
    CoverExchanges cover(steps, covers, {0, 3, 3, 5});
    for (int exchange = 0; exchange < 10; ++exchange) {
      for (size_t place = 0; place < 4; ++place) {
        const std::vector<double> with = shares.WorthWithEach(place);
        EXPECT_EQ(with, cover.WorthWithEach(place));
        ASSERT_EQ(with.size(), columns.size());
        for (size_t scan = 0; scan < columns.size(); ++scan) {
          PoolPlan plan = shares.plan();
          plan[place] = scan;
          EXPECT_DOUBLE_EQ(with[scan], pool.Worth(plan));
          EXPECT_EQ(with[scan], shares.WorthWith(place, scan));
          EXPECT_EQ(with[scan], cover.WorthWith(place, scan));
        }
      }
      const auto place = static_cast<size_t>(random.Below(4));
      const auto scan = static_cast<size_t>(random.Below(12));
      shares.Exchange(place, scan);
      cover.Exchange(place, scan);
      EXPECT_EQ(shares.plan(), cover.plan());
    }
  }
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
  const std::vector<TargetBits> sets = ClassicTrap(6, &targets);
  const ScanPool pool = PoolOf(sets, targets);
  const auto all = static_cast<double>(targets);
  PoolPlan greedy;
  pool.CompleteGreedily(greedy, 100, all);
  EXPECT_EQ(greedy.size(), 6u);

  PoolPlan two;
  pool.CompleteGreedily(two, 2, all);
  EXPECT_LT(pool.Worth(two), all);
  Random random(1);
  const PoolPlan best = pool.Anneal(two, 0, all, 20000, random, [] { return false; });
  EXPECT_EQ(best.size(), 2u);
  EXPECT_EQ(pool.Worth(best), all);
}

TEST(ScanPoolTest, AnnealingKeepsSizeAndFixedScansAndNeverLoses) {
  Random random(3);
  const size_t targets = 300;
  std::vector<TargetBits> sets;
  for (int i = 0; i < 120; ++i) sets.push_back(RandomBits(targets, 0.15, random));
  const ScanPool pool = PoolOf(sets, targets);
  PoolPlan plan = {5, 9};
  pool.CompleteGreedily(plan, 7, 300);
  ASSERT_EQ(plan.size(), 7u);
  const PoolPlan better = pool.Anneal(plan, 2, 300, 20000, random, [] { return false; });
  ASSERT_EQ(better.size(), 7u);
  EXPECT_EQ(better[0], 5u);
  EXPECT_EQ(better[1], 9u);
  EXPECT_GT(pool.Worth(better), pool.Worth(plan));
}

TEST(ScanPoolTest, AnnealingFindsTheBestOfAllTriples) {
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    Random random(seed);
    const size_t targets = 400;
    std::vector<TargetBits> sets;
    for (int i = 0; i < 40; ++i) sets.push_back(RandomBits(targets, 0.25, random));
    const ScanPool pool = PoolOf(sets, targets);
    double most = 0;
    for (size_t a = 0; a < sets.size(); ++a) {
      for (size_t b = a + 1; b < sets.size(); ++b) {
        for (size_t c = b + 1; c < sets.size(); ++c) {
          most = std::max(most, pool.Worth({a, b, c}));
        }
      }
    }
    const PoolPlan best =
        pool.Anneal({0, 1, 2}, 0, pool.MostWorth(), 20000, random, [] { return false; });
    EXPECT_EQ(pool.Worth(best), most) << "seed " << seed;
  }
}

TEST(ScanPoolTest, AnnealingStops) {
  Random random(3);
  std::vector<TargetBits> sets;
  for (int i = 0; i < 40; ++i) sets.push_back(RandomBits(100, 0.25, random));
  const ScanPool pool = PoolOf(sets, 100);
  int asked = 0;
  const PoolPlan best = pool.Anneal({0, 1, 2}, 0, pool.MostWorth(), int64_t{1} << 40, random,
                                    [&] { return ++asked >= 3; });
  EXPECT_EQ(asked, 3);
  EXPECT_EQ(best.size(), 3U);
}

}  // namespace
}  // namespace sightline
