// SPDX-License-Identifier: Apache-2.0
#include "planning/pareto/timed_choice.h"

#include <algorithm>
#include <limits>

#include "planning/strategy/scan_order.h"

namespace sightline {
namespace {

constexpr double kBetter = 1e-9;
// Lower limit of a scan's time in worth per second, for scans that take no time.
constexpr double kLeastTimeInChoice_s = 1e-3;
constexpr int kMaxExchanges = 1000;

// Seconds of moving that `scan` adds between two scans, either of which may be missing.
double Detour(const ExecutionModel& execution, const Measurement* before, const Measurement& scan,
              const Measurement* after) {
  double added_s = 0;
  if (before == nullptr && after == nullptr) return TimesBeforeFirst(execution).Total_s();
  if (before != nullptr) added_s += RepositionTimeS(execution, *before, scan);
  if (after != nullptr) added_s += RepositionTimeS(execution, scan, *after);
  if (before != nullptr && after != nullptr) added_s -= RepositionTimeS(execution, *before, *after);
  return added_s;
}

template <typename T>
std::vector<const T*> PointersTo(const std::vector<T>& values) {
  std::vector<const T*> pointers;
  for (const T& value : values) pointers.push_back(&value);
  return pointers;
}

PoolPlan Without(PoolPlan plan, size_t place) {
  plan.erase(plan.begin() + static_cast<std::ptrdiff_t>(place));
  return plan;
}

}  // namespace

PoolPlan TimedChoice::InOrder(const PoolPlan& plan, size_t fixed) const {
  std::vector<Measurement> scans;
  for (const size_t scan : plan) scans.push_back(scans_[scan]);
  PoolPlan order;
  for (const int i : OrderScans(execution_, scans, static_cast<int>(fixed))) {
    order.push_back(plan[static_cast<size_t>(i)]);
  }
  return order;
}

double TimedChoice::TimeS(const PoolPlan& plan, size_t fixed) const {
  const PoolPlan order = InOrder(plan, fixed);
  double time_s = order.empty() ? 0 : TimesBeforeFirst(execution_).Total_s();
  for (size_t i = 0; i < order.size(); ++i) {
    time_s += scan_s_[order[i]];
    if (i > 0) time_s += RepositionTimeS(execution_, scans_[order[i - 1]], scans_[order[i]]);
  }
  return time_s;
}

double TimedChoice::AddedS(const std::vector<Measurement>& order, size_t fixed,
                           const Measurement& scan, double scan_s) const {
  double least_s = std::numeric_limits<double>::infinity();
  for (size_t place = fixed; place <= order.size(); ++place) {
    least_s = std::min(least_s, Detour(execution_, place > 0 ? &order[place - 1] : nullptr, scan,
                                       place < order.size() ? &order[place] : nullptr));
  }
  return scan_s + least_s;
}

TimedChoice::Moves TimedChoice::MovesFrom(size_t scan) const {
  Moves moves;
  moves.reserve(scans_.size());
  for (const Measurement& other : scans_) {
    moves.push_back(RepositionTimeS(execution_, scans_[scan], other));
  }
  return moves;
}

std::vector<double> TimedChoice::AddedByEach(const PoolPlan& order,
                                             const std::vector<const Moves*>& moves,
                                             size_t fixed) const {
  std::vector<double> added_s(scans_.size(), std::numeric_limits<double>::infinity());
  for (size_t place = fixed; place <= order.size(); ++place) {
    const bool first = place == 0, last = place == order.size();
    double direct_s = first || last ? 0 : (*moves[place - 1])[order[place]];
    if (order.empty()) direct_s = -TimesBeforeFirst(execution_).Total_s();
    for (size_t scan = 0; scan < scans_.size(); ++scan) {
      const double detour_s =
          (first ? 0 : (*moves[place - 1])[scan]) + (last ? 0 : (*moves[place])[scan]) - direct_s;
      added_s[scan] = std::min(added_s[scan], scan_s_[scan] + detour_s);
    }
  }
  return added_s;
}

void TimedChoice::Shorten(PoolPlan& plan, size_t fixed, double limit_s) const {
  while (plan.size() > fixed) {
    const double time_s = TimeS(plan, fixed);
    if (time_s <= limit_s) return;
    const double worth = pool_.Worth(plan);
    size_t weakest = fixed;
    double least = std::numeric_limits<double>::infinity();
    for (size_t place = fixed; place < plan.size(); ++place) {
      const PoolPlan rest = Without(plan, place);
      const double saved_s = std::max(kLeastTimeInChoice_s, time_s - TimeS(rest, fixed));
      if (const double lost = (worth - pool_.Worth(rest)) / saved_s; lost < least) {
        least = lost;
        weakest = place;
      }
    }
    plan = Without(plan, weakest);
  }
}

void TimedChoice::Fill(PoolPlan& plan, size_t fixed, double limit_s, size_t most_scans,
                       bool per_second) const {
  while (plan.size() < most_scans) {
    const PoolPlan order = InOrder(plan, fixed);
    std::vector<Moves> moves;
    for (const size_t scan : order) moves.push_back(MovesFrom(scan));
    const double time_s = TimeS(plan, fixed), worth = pool_.Worth(plan);
    const std::vector<double> with = pool_.WorthWithEach(plan);
    const std::vector<double> added_s = AddedByEach(order, PointersTo(moves), fixed);
    size_t best = with.size();
    double best_value = 0;
    for (size_t scan = 0; scan < with.size(); ++scan) {
      if (with[scan] <= worth + kBetter || time_s + added_s[scan] > limit_s) continue;
      const double gain = with[scan] - worth;
      const double value = per_second ? gain / std::max(kLeastTimeInChoice_s, added_s[scan]) : gain;
      if (value > best_value) {
        best_value = value;
        best = scan;
      }
    }
    if (best == with.size()) return;
    plan.push_back(best);
  }
}

void TimedChoice::ExchangeWhileBetter(PoolPlan& plan, size_t fixed, double limit_s) const {
  double worth = pool_.Worth(plan), time_s = TimeS(plan, fixed);
  for (int exchange = 0; exchange < kMaxExchanges; ++exchange) {
    const PoolPlan order = InOrder(plan, fixed);
    std::vector<Moves> moves;
    for (const size_t scan : order) moves.push_back(MovesFrom(scan));
    double best_worth = worth, best_s = time_s;
    size_t best_place = order.size(), best_scan = 0;
    for (size_t place = fixed; place < order.size(); ++place) {
      // The other scans keep their order, which may be slightly longer than their best one.
      const PoolPlan others = Without(order, place);
      std::vector<const Moves*> others_moves = PointersTo(moves);
      others_moves.erase(others_moves.begin() + static_cast<std::ptrdiff_t>(place));
      double others_s = others.empty() ? 0 : TimesBeforeFirst(execution_).Total_s();
      for (size_t i = 0; i < others.size(); ++i) {
        others_s += scan_s_[others[i]] + (i > 0 ? (*others_moves[i - 1])[others[i]] : 0);
      }
      const std::vector<double> with = pool_.WorthWithEach(others);
      const std::vector<double> added_s = AddedByEach(others, others_moves, fixed);
      for (size_t scan = 0; scan < with.size(); ++scan) {
        const double with_s = others_s + added_s[scan];
        if (with_s > limit_s || with[scan] < best_worth - kBetter) continue;
        if (with[scan] <= best_worth + kBetter && with_s >= best_s - kBetter) continue;
        best_worth = with[scan];
        best_s = with_s;
        best_place = place;
        best_scan = scan;
      }
    }
    if (best_place == order.size()) return;
    plan = order;
    plan[best_place] = best_scan;
    worth = pool_.Worth(plan);
    time_s = TimeS(plan, fixed);
  }
}

PoolPlan TimedChoice::Improve(PoolPlan plan, size_t fixed, double limit_s, size_t most_scans,
                              int rounds, Random& random, const std::function<bool()>& stop) const {
  if (scans_.empty() || stop()) return plan;
  Fill(plan, fixed, limit_s, most_scans, true);
  ExchangeWhileBetter(plan, fixed, limit_s);
  Fill(plan, fixed, limit_s, most_scans, false);
  double worth = pool_.Worth(plan), time_s = TimeS(plan, fixed);
  for (int round = 0; round < rounds && !stop(); ++round) {
    PoolPlan trial = plan;
    const auto removable = static_cast<int64_t>(trial.size() - fixed);
    const int64_t removed = removable == 0 ? 0 : 1 + random.Below(std::min<int64_t>(3, removable));
    for (int64_t r = 0; r < removed; ++r) {
      const int64_t place = random.Below(static_cast<int64_t>(trial.size() - fixed));
      trial = Without(trial, fixed + static_cast<size_t>(place));
    }
    // Adds one random scan of the pool, if it fits, to leave local optima.
    PoolPlan with = trial;
    with.push_back(static_cast<size_t>(random.Below(static_cast<int64_t>(scans_.size()))));
    if (with.size() <= most_scans && TimeS(with, fixed) <= limit_s) trial = std::move(with);
    Fill(trial, fixed, limit_s, most_scans, round % 2 == 0);
    ExchangeWhileBetter(trial, fixed, limit_s);
    Fill(trial, fixed, limit_s, most_scans, false);
    const double trial_worth = pool_.Worth(trial), trial_s = TimeS(trial, fixed);
    if (trial_worth > worth + kBetter || (trial_worth > worth - kBetter && trial_s <= time_s)) {
      worth = trial_worth;
      time_s = trial_s;
      plan = std::move(trial);
    }
  }
  return plan;
}

}  // namespace sightline
