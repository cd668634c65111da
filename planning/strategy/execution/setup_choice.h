// SPDX-License-Identifier: Apache-2.0
// Chooses scans from a pool so that a plan of given worth takes the least time to execute. The cost
// of a new set-up counts in the choice of the next scan.
//
// Large neighbourhood search (Shaw 1998; ruin and recreate, Schrimpf et al. 2000): a place of the
// sensors, a resting face, a set-up or a few scans leave the plan, and a greedy choice by worth per
// second completes it. A scan costs little in a set-up that the plan has, and otherwise a change of
// face or sensors. Each round adds a random number of seconds to every scan's cost, since too many
// cheap scans would use up the number of scans.
#pragma once

#include <functional>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "core/inspection/inspection.h"
#include "core/random/random.h"
#include "planning/strategy/pool/scan_pool.h"

namespace sightline {

// Set-up and duration of a scan of the pool.
struct SetupOfScan {
  size_t place = 0;  // number of the place of the sensors
  size_t rest = 0;   // number of the resting face
  double scan_s = 0;
};

struct SetupLimits {
  size_t scans = 40;
  std::optional<double> time_s;
  std::optional<int> setups, places, rests;
};

class SetupChoice {
 public:
  // `scans`: one per scan of the pool. All references must outlive the choice.
  SetupChoice(const ScanPool& pool, const std::vector<SetupOfScan>& scans, const CostModel& costs,
              const SetupLimits& limits);

  // Time of the plan's scans [s] in the best order of its set-ups that nearest-neighbour tours from
  // every start find. Each scan after the first of a set-up costs a turn. The repositioning speeds
  // of CostModel are ignored. 0 without scans.
  double TimeS(const PoolPlan& plan) const;
  bool KeepsLimits(const PoolPlan& plan) const;

  // Returns the fastest plan found in `rounds` rounds that is worth `aim`, or as much of it as the
  // limits allow. It is never worse than `plan` if that keeps the limits. The first `fixed` scans
  // stay. `stop` is called every round.
  PoolPlan Improve(PoolPlan plan, size_t fixed, double aim, int rounds, Random& random,
                   const std::function<bool()>& stop) const;

 private:
  using Setup = std::pair<size_t, size_t>;  // place, rest
  struct Value {
    double worth, time_s;  // worth at most `aim`
  };

  double BetweenS(const Setup& a, const Setup& b) const;
  double TourS(const std::set<Setup>& setups) const;
  std::set<Setup> SetupsOf(const PoolPlan& plan) const;
  // Seconds that one more scan in each set-up of the pool adds, without the scan itself; infinite
  // if it exceeds the limits. A new set-up is inserted next to the nearest one of the plan.
  std::vector<double> AddedByEach(const PoolPlan& plan) const;
  Value ValueOf(const PoolPlan& plan, double aim) const;
  static bool Better(const Value& a, const Value& b);
  // Removes some scans from position `fixed` on.
  void Ruin(PoolPlan& plan, size_t fixed, Random& random, std::optional<size_t>* without_place,
            std::optional<size_t>* without_rest) const;
  void Recreate(PoolPlan& plan, double aim, double extra_s, std::optional<size_t> without_place,
                std::optional<size_t> without_rest) const;
  // Removes scans without which the plan is still worth `aim`; first those that save most
  // time.
  void Prune(PoolPlan& plan, size_t fixed, double aim) const;

  const ScanPool& pool_;
  const std::vector<SetupOfScan>& scans_;
  const CostModel& costs_;
  const SetupLimits limits_;
  std::vector<Setup> setups_;     // of the pool
  std::vector<size_t> setup_of_;  // of every scan, index into setups_
};

}  // namespace sightline
