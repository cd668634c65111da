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

// Targets that a pool uses, ascending: all toleranced ones, or a random sample of
// `pairs` / `steps` of them if the number of pairs of target and step clearly exceeds
// `pairs`.
std::vector<uint32_t> TargetSample(const TargetBits& measurable, size_t steps, size_t pairs,
                                   Random& random);

// Fractions of every step's threshold that each scan of the pool gives to a sample of the targets,
// in units of 1/127. The worth of a plan is counted over bytes, or over bits if all fractions are 0
// or 1.
class ScanPool {
 public:
  // `targets`: the targets that the pool uses, ascending.
  ScanPool(std::vector<ShareStep> steps, std::vector<uint32_t> targets);

  size_t size() const { return columns_.size(); }
  // Adds a scan and returns its index.
  size_t Add(const TargetShares& shares);
  // Removes all information from the scan.
  void Empty(size_t scan);
  // Keeps only these scans (ascending); they get the indices 0, 1, ...
  void Keep(const std::vector<size_t>& kept);

  double Worth(const PoolPlan& plan) const;
  // Worth of the plan with each scan of the pool added to it.
  std::vector<double> WorthWithEach(const PoolPlan& plan) const;
  // Worth if every target reached every step.
  double MostWorth() const;
  // For each scan of the pool: the gain of adding it to the plan, plus the largest gain of
  // replacing one of the plan's scans by it.
  std::vector<double> Promise(const PoolPlan& plan) const;

  // Adds the scan that is worth most (the first if equal) until the plan has `size` scans, is worth
  // `goal`, or no scan adds anything.
  void CompleteGreedily(PoolPlan& plan, size_t size, double goal) const;
  // Repeats the best exchange of a plan's scan, from position `fixed` on, for one of the pool as
  // long as that raises the worth.
  void ExchangeWhileBetter(PoolPlan& plan, size_t fixed) const;
  // Simulated annealing (Kirkpatrick et al. 1983) with `proposals` exchanges of one scan of the
  // plan, from position `fixed` on, for one of the pool. The temperature falls geometrically from
  // 1/200 of the largest worth to 1/50 of that. Exchanges that raise the worth follow. Returns the
  // best plan found. Stops at a worth of `goal`, or when `stop` returns true (called every 1024
  // proposals).
  PoolPlan Anneal(PoolPlan plan, size_t fixed, double goal, int64_t proposals, Random& random,
                  const std::function<bool()>& stop) const;

 private:
  using Column = ShareColumn;

  // Targets satisfied by the plan's scans, and the worth of the union of two sets; only if all
  // fractions are 0 or 1.
  CoverColumn CoveredBy(const PoolPlan& plan) const;
  double WorthOf(const CoverColumn& once, const CoverColumn& also) const;
  // The remaining need of every target at every step.
  Column NeedAfter(const PoolPlan& plan) const;
  double WorthWith(const Column& need, const Column& added) const;

  std::vector<ShareStep> steps_;
  std::vector<uint32_t> targets_;
  std::vector<Column> columns_;
  // columns_ as bits, if every fraction is 0 or 1.
  std::vector<CoverColumn> covers_;
  bool only_whole_ = true;
};

}  // namespace sightline
