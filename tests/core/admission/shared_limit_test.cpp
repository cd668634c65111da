// SPDX-License-Identifier: Apache-2.0
#include "core/admission/shared_limit.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

namespace sightline {
namespace {

TEST(SharedLimit, CountsByOwnerAndInAll) {
  const SharedLimit limit(100, 60);
  SharedLimit::Share first = limit.Of("a");
  EXPECT_FALSE(first.Grow(50));
  {
    SharedLimit::Share second = limit.Of("a");
    EXPECT_FALSE(second.Grow(10));
    const std::optional<Shortage> own = second.Grow(1);
    ASSERT_TRUE(own);
    EXPECT_TRUE(own->of_owner);
    EXPECT_EQ(own->held, 60);
    EXPECT_EQ(own->limit, 60);
    SharedLimit::Share other = limit.Of("b");
    EXPECT_FALSE(other.Grow(40));
    const std::optional<Shortage> of_all = other.Grow(1);
    ASSERT_TRUE(of_all);
    EXPECT_FALSE(of_all->of_owner);
    EXPECT_EQ(of_all->held, 100);
    EXPECT_EQ(of_all->limit, 100);
    // Refused amounts were not taken.
    EXPECT_EQ(second.held(), 10);
    EXPECT_EQ(other.held(), 40);
    EXPECT_EQ(limit.held(), 100);
  }
  EXPECT_EQ(limit.held(), 50);
  SharedLimit::Share moved(std::move(first));
  EXPECT_FALSE(moved.Grow(10));
  EXPECT_EQ(limit.held(), 60);
  moved = limit.Of("b");
  EXPECT_EQ(limit.held(), 0);
}

TEST(SharedLimit, WhatAloneExceedsItIsThereAlone) {
  const SharedLimit limit(100, 60);
  SharedLimit::Share large = limit.Of("a");
  EXPECT_FALSE(large.Grow(1000));
  EXPECT_TRUE(limit.Of("b").Grow(1));
  large.GiveBack();
  SharedLimit::Share small = limit.Of("b");
  EXPECT_FALSE(small.Grow(1));
  EXPECT_TRUE(large.Grow(1000));
  // More than an owner's share, which the others leave room for.
  EXPECT_FALSE(large.Grow(99));
  EXPECT_TRUE(large.Grow(1));
}

TEST(SharedLimit, AShareOfNobodyHoldsNothing) {
  SharedLimit::Share share;
  EXPECT_TRUE(share.Grow(1));
  EXPECT_EQ(share.held(), 0);
}

TEST(SharedLimit, IsOutlivedByItsShares) {
  std::optional<SharedLimit> limit(std::in_place, 2, 1);
  SharedLimit::Share share = limit->Of("a");
  EXPECT_FALSE(share.Grow(1));
  limit.reset();
  EXPECT_TRUE(share.Grow(1));
}

TEST(SharedLimit, ThreadsGetNoMoreThanThereIs) {
  const SharedLimit limit(5, 3);
  std::atomic<int> have = 0, most = 0, taken = 0;
  std::vector<std::thread> threads;
  for (int i = 0; i < 8; ++i) {
    threads.emplace_back([&, owner = std::string(1, static_cast<char>('a' + i % 2))] {
      for (int k = 0; k < 500; ++k) {
        SharedLimit::Share share = limit.Of(owner);
        if (share.Grow(1)) continue;
        ++taken;
        const int now = ++have;
        int before = most;
        while (now > before && !most.compare_exchange_weak(before, now)) {
        }
        --have;
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_GT(taken, 0);
  EXPECT_LE(most, 5);
  EXPECT_EQ(limit.held(), 0);
}

}  // namespace
}  // namespace sightline
