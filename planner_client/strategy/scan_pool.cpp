#include "planner_client/strategy/scan_pool.h"

#include <algorithm>

#include "planner_client/strategy/cover_bits.h"

namespace sightline {

TargetBits CoveredBy(const std::vector<TargetBits>& pool, const PoolPlan& plan, size_t targets) {
  TargetBits covered(targets);
  for (size_t set : plan) covered |= pool[set];
  return covered;
}

std::vector<TargetBits> UniqueTargets(const std::vector<TargetBits>& pool, const PoolPlan& plan,
                                      size_t targets) {
  // Bits covered at least once and at least twice.
  TargetBits once(targets), twice(targets);
  for (size_t set : plan) {
    TargetBits again = once;
    again &= pool[set];
    twice |= again;
    once |= pool[set];
  }
  std::vector<TargetBits> unique;
  for (size_t set : plan) unique.push_back(TargetBits(pool[set]).Subtract(twice));
  return unique;
}

void CompleteGreedily(const std::vector<TargetBits>& pool, PoolPlan& plan, size_t size,
                      int64_t goal, size_t targets) {
  TargetBits covered = CoveredBy(pool, plan, targets);
  // Last known gains bound the present ones from above.
  std::vector<int64_t> bound(pool.size(), static_cast<int64_t>(targets));
  while (plan.size() < size && covered.Count() < goal) {
    int64_t best_gain = 0;
    size_t best = pool.size();
    for (size_t set = 0; set < pool.size(); ++set) {
      if (bound[set] <= best_gain) continue;
      bound[set] = CountOnlyIn(pool[set], covered);
      if (bound[set] > best_gain) {
        best_gain = bound[set];
        best = set;
      }
    }
    if (best == pool.size()) break;
    plan.push_back(best);
    covered |= pool[best];
  }
}

void ExchangeWhileBetter(const std::vector<TargetBits>& pool, PoolPlan& plan, size_t fixed,
                         size_t targets) {
  while (true) {
    const TargetBits covered = CoveredBy(pool, plan, targets);
    const std::vector<TargetBits> unique = UniqueTargets(pool, plan, targets);
    std::vector<int64_t> loss;
    for (const TargetBits& bits : unique) loss.push_back(bits.Count());
    int64_t best_gain = 0;
    size_t best_place = 0, best_set = 0;
    for (size_t set = 0; set < pool.size(); ++set) {
      const int64_t fresh = CountOnlyIn(pool[set], covered);
      for (size_t place = fixed; place < plan.size(); ++place) {
        if (fresh + CountInBoth(pool[set], unique[place]) - loss[place] > best_gain) {
          best_gain = fresh + CountInBoth(pool[set], unique[place]) - loss[place];
          best_place = place;
          best_set = set;
        }
      }
    }
    if (best_gain == 0) return;
    plan[best_place] = best_set;
  }
}

PoolPlan ImproveCoverage(const std::vector<TargetBits>& pool, PoolPlan plan, size_t fixed,
                         int64_t goal, int rounds, size_t targets, Random& random,
                         const std::function<bool()>& stop) {
  const size_t size = plan.size();
  if (size <= fixed || pool.empty()) return plan;
  ExchangeWhileBetter(pool, plan, fixed, targets);
  int64_t best = CoveredBy(pool, plan, targets).Count();
  for (int round = 0; round < rounds && best < goal && plan.size() > fixed && !stop(); ++round) {
    PoolPlan trial = plan;
    // A plan may have become smaller: sets that add nothing are not put back.
    const auto removable = static_cast<int64_t>(trial.size() - fixed);
    const int64_t removed = 1 + random.Below(std::min<int64_t>(3, removable));
    for (int64_t r = 0; r < removed; ++r) {
      trial.erase(trial.begin() + static_cast<std::ptrdiff_t>(fixed) +
                  random.Below(static_cast<int64_t>(trial.size() - fixed)));
    }
    // One random set of the pool instead of the greedy choice leads elsewhere.
    trial.push_back(static_cast<size_t>(random.Below(static_cast<int64_t>(pool.size()))));
    CompleteGreedily(pool, trial, size, goal, targets);
    if (trial.size() > size) trial.resize(size);
    ExchangeWhileBetter(pool, trial, fixed, targets);
    const int64_t covered = CoveredBy(pool, trial, targets).Count();
    if (covered >= best) {
      best = covered;
      plan = std::move(trial);
    }
  }
  return plan;
}

}  // namespace sightline
