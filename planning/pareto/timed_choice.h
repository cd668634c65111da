// SPDX-License-Identifier: Apache-2.0
// Choosing scans out of a pool so that targets are worth most within a number of seconds.
#pragma once

#include <functional>
#include <vector>

#include "core/inspection/inspection.h"
#include "core/random/random.h"
#include "core/rig/measurement.h"
#include "planning/strategy/execution/execution_model.h"
#include "planning/strategy/pool/scan_pool.h"

namespace sightline {

// A budgeted maximum coverage problem in which the cost of a scan is its own seconds and the
// detour of moving there. Greedy choice by worth per second (Khuller, Moss, Naor 1999) and by
// worth, exchanges, ruin and recreate.
class TimedChoice {
 public:
  // The arguments have one entry per scan of the pool. The references must outlive this.
  TimedChoice(const ExecutionModel& execution, const ScanPool& pool,
              const std::vector<Measurement>& scans, const std::vector<double>& scan_s)
      : execution_(execution), pool_(pool), scans_(scans), scan_s_(scan_s) {}

  // In the best order, the first `fixed` scans first.
  double TimeS(const PoolPlan& plan, size_t fixed) const;
  // Brings a plan within the limit: takes out the scan (from place `fixed` on) whose worth per
  // second is least, as long as that takes. The fixed ones stay even if they alone take longer.
  void Shorten(PoolPlan& plan, size_t fixed, double limit_s) const;
  // A plan worth no less and within the limit, as the given one is, of at most `most_scans`; see
  // above. Stops after `rounds` rounds, or when `stop` says so.
  PoolPlan Improve(PoolPlan plan, size_t fixed, double limit_s, size_t most_scans, int rounds,
                   Random& random, const std::function<bool()>& stop) const;
  // Seconds by which a scan makes a plan longer if it is put in at its best place; `order`: a plan
  // in the order in which it is executed.
  double AddedS(const std::vector<Measurement>& order, size_t fixed, const Measurement& scan,
                double scan_s) const;
  // The plan in the order in which it is executed.
  PoolPlan InOrder(const PoolPlan& plan, size_t fixed) const;

 private:
  // Seconds of moving from a scan to every scan of the pool.
  using Moves = std::vector<double>;
  Moves MovesFrom(size_t scan) const;
  // As AddedS for every scan of the pool; `moves`: one per scan of the order.
  std::vector<double> AddedByEach(const PoolPlan& order, const std::vector<const Moves*>& moves,
                                  size_t fixed) const;
  // Adds scans that fit, by worth per added second or by worth alone.
  void Fill(PoolPlan& plan, size_t fixed, double limit_s, size_t most_scans, bool per_second) const;
  // Exchanges while that is worth more, or as much in less time.
  void ExchangeWhileBetter(PoolPlan& plan, size_t fixed, double limit_s) const;

  const ExecutionModel& execution_;
  const ScanPool& pool_;
  const std::vector<Measurement>& scans_;
  const std::vector<double>& scan_s_;
};

}  // namespace sightline
