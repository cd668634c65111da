// SPDX-License-Identifier: Apache-2.0
// Chooses scans from a pool for the largest worth of targets within a number of seconds.
#pragma once

#include <functional>
#include <vector>

#include "core/inspection/inspection.h"
#include "core/random/random.h"
#include "core/rig/measurement.h"
#include "planning/strategy/execution/execution_model.h"
#include "planning/strategy/pool/scan_pool.h"

namespace sightline {

// Solves a budgeted maximum coverage problem: a scan costs its own seconds plus the detour of
// moving to it. The method is greedy choice by worth per second (Khuller, Moss, Naor 1999) and by
// worth, then exchanges, then ruin and recreate.
class TimedChoice {
 public:
  // The arguments have one entry per scan of the pool. The references must outlive this.
  TimedChoice(const ExecutionModel& execution, const ScanPool& pool,
              const std::vector<Measurement>& scans, const std::vector<double>& scan_s)
      : execution_(execution), pool_(pool), scans_(scans), scan_s_(scan_s) {}

  // Seconds of the plan in its best order, in which the first `fixed` scans stay first.
  double TimeS(const PoolPlan& plan, size_t fixed) const;
  // Brings a plan within the limit: removes the scan (from position `fixed` on) with the least
  // worth per second until the plan fits. The fixed scans stay even if they alone exceed the limit.
  void Shorten(PoolPlan& plan, size_t fixed, double limit_s) const;
  // Returns a plan within the limit that is worth at least as much as `plan` (itself within the
  // limit), with at most `most_scans`. Stops after `rounds` rounds, or when `stop` returns true.
  PoolPlan Improve(PoolPlan plan, size_t fixed, double limit_s, size_t most_scans, int rounds,
                   Random& random, const std::function<bool()>& stop) const;
  // Seconds that a scan adds to a plan at its best position. `order`: the plan in the order of
  // execution.
  double AddedS(const std::vector<Measurement>& order, size_t fixed, const Measurement& scan,
                double scan_s) const;
  // The plan's scans in the order of execution.
  PoolPlan InOrder(const PoolPlan& plan, size_t fixed) const;

 private:
  // Seconds of moving from a scan to every scan of the pool.
  using Moves = std::vector<double>;
  Moves MovesFrom(size_t scan) const;
  // AddedS of every scan of the pool; `moves`: one element per scan of `order`.
  std::vector<double> AddedByEach(const PoolPlan& order, const std::vector<const Moves*>& moves,
                                  size_t fixed) const;
  // Adds scans that fit, by worth per added second or by worth alone.
  void Fill(PoolPlan& plan, size_t fixed, double limit_s, size_t most_scans, bool per_second) const;
  // Exchanges scans while that raises the worth, or keeps it in less time.
  void ExchangeWhileBetter(PoolPlan& plan, size_t fixed, double limit_s) const;

  const ExecutionModel& execution_;
  const ScanPool& pool_;
  const std::vector<Measurement>& scans_;
  const std::vector<double>& scan_s_;
};

}  // namespace sightline
