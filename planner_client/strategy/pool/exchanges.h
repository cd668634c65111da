// SPDX-License-Identifier: Apache-2.0
// What a plan is worth when one of its scans gives way to another of the pool.
//
// Two ways to know it: by sums of shares, and, where every scan settles a target or tells nothing
// of it, by bits, of which sixty-four targets take one step. Both give the same numbers.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "planner_client/strategy/target_shares.h"

namespace sightline {

// Indices of scans in a pool.
using PoolPlan = std::vector<size_t>;

// Of one scan, [step][target]: its share as a part of the step's threshold, in units of
// 1 / kWholeShare.
using ShareColumn = std::vector<uint8_t>;
inline constexpr uint8_t kWholeShare = 127;  // two of them still fit into a byte

// Number of places at which `added` reaches `need`.
int64_t CountReached(const uint8_t* need, const uint8_t* added, size_t size);

// A plan and the columns of all scans of its pool (one at least), of which every step has `targets`
// entries. Steps and columns must outlive it.
class ShareExchanges {
 public:
  ShareExchanges(const std::vector<ShareStep>& steps, size_t targets,
                 const std::vector<ShareColumn>& columns, PoolPlan plan);

  const PoolPlan& plan() const { return plan_; }
  double WorthWith(size_t place, size_t scan) const;
  // With every scan of the pool in that place.
  std::vector<double> WorthWithEach(size_t place) const;
  void Exchange(size_t place, size_t scan);

 private:
  const std::vector<ShareStep>& steps_;
  const size_t targets_;
  const std::vector<ShareColumn>& columns_;
  PoolPlan plan_;
  // Of the plan's scans. Not saturated, so that scans can be taken out again.
  std::vector<uint16_t> sum_;
};

// A bit for every target that the scan settles, [step][word of 64 targets].
using CoverColumn = std::vector<uint64_t>;

// Targets whose shares are whole.
CoverColumn WholeShares(const ShareColumn& column, size_t steps, size_t targets);

// The same as ShareExchanges for scans whose shares are all 0 or whole.
class CoverExchanges {
 public:
  CoverExchanges(const std::vector<ShareStep>& steps, const std::vector<CoverColumn>& columns,
                 PoolPlan plan);

  const PoolPlan& plan() const { return plan_; }
  double WorthWith(size_t place, size_t scan) const;
  std::vector<double> WorthWithEach(size_t place) const;
  void Exchange(size_t place, size_t scan);

 private:
  // Finds out again what the plan's scans settle.
  void Count();

  const std::vector<ShareStep>& steps_;
  const std::vector<CoverColumn>& columns_;
  PoolPlan plan_;
  CoverColumn once_, twice_;  // settled by one scan or more, by two or more
};

}  // namespace sightline
