// SPDX-License-Identifier: Apache-2.0
// Chooses a given number of scans out of a pool for the largest worth (maximum coverage; with
// fractions, multi-coverage).
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "core/random/random.h"
#include "planning/strategy/pool/exchanges.h"
#include "planning/strategy/target_shares.h"

namespace sightline {

// Targets that a pool may look at, ascending: all toleranced ones, or a random part of `pairs` /
// `steps` of them where pairs of a target and one of `steps` steps of its worth are clearly more
// than `pairs`.
std::vector<uint32_t> TargetSample(const TargetBits& measurable, size_t steps, size_t pairs,
                                   Random& random);

// Fractions of every step's threshold that the pool's scans give to some of the targets, in units
// of 1/127. A plan's worth is a count over bytes, or over bits if all fractions are 0 or 1.
class ScanPool {
 public:
  // `targets`: those that the pool looks at, ascending.
  ScanPool(std::vector<ShareStep> steps, std::vector<uint32_t> targets);

  size_t size() const { return columns_.size(); }
  // Index of the scan.
  size_t Add(const TargetShares& shares);
  // The scan has no information any more.
  void Empty(size_t scan);
  // Keeps these scans only, ascending; they get the indices 0, 1, ...
  void Keep(const std::vector<size_t>& kept);

  double Worth(const PoolPlan& plan) const;
  // Worth of the plan with each scan of the pool added.
  std::vector<double> WorthWithEach(const PoolPlan& plan) const;
  // If every target reached every step.
  double MostWorth() const;
  // Gain of each scan of the pool if added to the plan, plus the largest gain of putting it in the
  // place of one of the plan's scans.
  std::vector<double> Promise(const PoolPlan& plan) const;

  // Adds the scan that is worth most (the first of equal ones) until the plan has `size` scans, is
  // worth `goal`, or no scan adds anything.
  void CompleteGreedily(PoolPlan& plan, size_t size, double goal) const;
  // Exchanges a scan of the plan, from place `fixed` on, for one of the pool as long as that is
  // worth more; the best exchange first.
  void ExchangeWhileBetter(PoolPlan& plan, size_t fixed) const;
  // Simulated annealing (Kirkpatrick et al. 1983) over exchanges of one scan of the plan, from
  // place `fixed` on, for one of the pool: `proposals` of them, at temperatures that fall in equal
  // ratios from a two-hundredth of the largest worth to a fiftieth of that; then exchanges while
  // better. The best plan met. Stops at a worth of `goal`, or when `stop`, asked now and then, says
  // so.
  PoolPlan Anneal(PoolPlan plan, size_t fixed, double goal, int64_t proposals, Random& random,
                  const std::function<bool()>& stop) const;

 private:
  using Column = ShareColumn;

  // Targets that the plan's scans satisfy, and worth of those that are in either set; only if all
  // fractions are 0 or 1.
  CoverColumn CoveredBy(const PoolPlan& plan) const;
  double WorthOf(const CoverColumn& once, const CoverColumn& also) const;
  // The remaining need of every target at every step.
  Column NeedAfter(const PoolPlan& plan) const;
  double WorthWith(const Column& need, const Column& added) const;

  std::vector<ShareStep> steps_;
  std::vector<uint32_t> targets_;
  std::vector<Column> columns_;
  // The same as columns_, if every fraction is 0 or 1.
  std::vector<CoverColumn> covers_;
  bool only_whole_ = true;
};

}  // namespace sightline
