// SPDX-License-Identifier: Apache-2.0
// Choosing scans out of a pool so that a plan of given worth takes the least time to execute, where
// the cost of a new set-up counts in choosing the next scan.
//
// Large neighbourhood search (Shaw 1998; ruin and recreate, Schrimpf et al. 2000): a place of the
// sensors, a resting face, a set-up or a few scans leave the plan, and the rest is completed
// greedily by worth per second. The seconds are those that the scan adds: little in a set-up that
// the plan has, the change of face or sensors in another. A random number of seconds is added to
// them in every round, since too many cheap scans use up the number of scans.
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

// Set-up of a scan of the pool, and how long the scan takes.
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
  // `scans`: one per scan of the pool; all must outlive the choice.
  SetupChoice(const ScanPool& pool, const std::vector<SetupOfScan>& scans, const CostModel& costs,
              const SetupLimits& limits);

  // Time of the plan's scans in the best order of its set-ups that nearest neighbours from every
  // start find [s]. A turn is counted for every scan after the first of a set-up; the speeds of
  // CostModel's repositioning are not counted. 0 for no scans.
  double TimeS(const PoolPlan& plan) const;
  bool KeepsLimits(const PoolPlan& plan) const;

  // A plan that is worth `aim`, or as much of it as the limits allow, in as little time as `rounds`
  // rounds find; never worse than `plan` if that keeps the limits. The first `fixed` scans stay.
  // `stop` is asked every round.
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
  // where it would not keep the limits. A new set-up is put beside the nearest one of the plan.
  std::vector<double> AddedByEach(const PoolPlan& plan) const;
  Value ValueOf(const PoolPlan& plan, double aim) const;
  static bool Better(const Value& a, const Value& b);
  // Scans from place `fixed` on leave the plan.
  void Ruin(PoolPlan& plan, size_t fixed, Random& random, std::optional<size_t>* without_place,
            std::optional<size_t>* without_rest) const;
  void Recreate(PoolPlan& plan, double aim, double extra_s, std::optional<size_t> without_place,
                std::optional<size_t> without_rest) const;
  // Leaves out scans without which the plan is still worth `aim`, the ones that save most time
  // first.
  void Prune(PoolPlan& plan, size_t fixed, double aim) const;

  const ScanPool& pool_;
  const std::vector<SetupOfScan>& scans_;
  const CostModel& costs_;
  const SetupLimits limits_;
  std::vector<Setup> setups_;     // of the pool
  std::vector<size_t> setup_of_;  // of every scan, index into setups_
};

}  // namespace sightline
