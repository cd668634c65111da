// SPDX-License-Identifier: Apache-2.0
// Worth of a plan when another scan of the pool replaces one of its scans.
//
// There are two ways to compute it: sums of fractions, or bits if every scan gives a target all its
// information or none. Bits process 64 targets at a time. Both give the same numbers.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "planning/strategy/target_shares.h"

namespace sightline {

// Indices of scans in a pool.
using PoolPlan = std::vector<size_t>;

// Column of one scan, [step][target]: its fraction of the step's threshold, in units of 1 /
// kWholeShare.
using ShareColumn = std::vector<uint8_t>;
inline constexpr uint8_t kWholeShare = 127;  // two of them still fit into a byte

// Number of elements at which `added` reaches `need`.
int64_t CountReached(const uint8_t* need, const uint8_t* added, size_t size);

// A plan and the columns of all scans of its pool (at least one). Each step of a column has
// `targets` elements. Steps and columns must outlive this object.
class ShareExchanges {
 public:
  ShareExchanges(const std::vector<ShareStep>& steps, size_t targets,
                 const std::vector<ShareColumn>& columns, PoolPlan plan);

  const PoolPlan& plan() const { return plan_; }
  double WorthWith(size_t place, size_t scan) const;
  // Worth of the plan with each scan of the pool in this position.
  std::vector<double> WorthWithEach(size_t place) const;
  void Exchange(size_t place, size_t scan);

 private:
  const std::vector<ShareStep>& steps_;
  const size_t targets_;
  const std::vector<ShareColumn>& columns_;
  PoolPlan plan_;
  // Sum of the columns of the plan's scans. Not saturated, so that scans can be taken out again.
  std::vector<uint16_t> sum_;
};

// A bit for every target that the scan satisfies, [step][word of 64 targets].
using CoverColumn = std::vector<uint64_t>;

// Targets that reach the whole threshold.
CoverColumn WholeShares(const ShareColumn& column, size_t steps, size_t targets);

// The same as ShareExchanges for scans whose fractions are all 0 or 1.
class CoverExchanges {
 public:
  CoverExchanges(const std::vector<ShareStep>& steps, const std::vector<CoverColumn>& columns,
                 PoolPlan plan);

  const PoolPlan& plan() const { return plan_; }
  double WorthWith(size_t place, size_t scan) const;
  std::vector<double> WorthWithEach(size_t place) const;
  void Exchange(size_t place, size_t scan);

 private:
  // Recounts the targets that the plan's scans satisfy.
  void Count();

  const std::vector<ShareStep>& steps_;
  const std::vector<CoverColumn>& columns_;
  PoolPlan plan_;
  CoverColumn once_, twice_;  // satisfied by one scan or more, by two or more
};

}  // namespace sightline
