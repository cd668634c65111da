// SPDX-License-Identifier: Apache-2.0
#include "planning/strategy/execution/setup_choice.h"

#include <algorithm>
#include <array>
#include <iterator>
#include <limits>
#include <map>

namespace sightline {
namespace {

constexpr double kEqualWorth = 1e-9;
constexpr double kInfeasible_s = std::numeric_limits<double>::infinity();
// Extra seconds per scan; each round picks one of these at random.
constexpr std::array<double, 6> kExtra_s = {0, 30, 120, 400, 1200, 4000};
// Fraction of time by which a plan may get longer in the first round; it shrinks to 0.
constexpr double kLonger = 0.05;

template <typename Condition>
void TakeOut(PoolPlan& plan, size_t fixed, const Condition& condition) {
  plan.erase(
      std::remove_if(plan.begin() + static_cast<std::ptrdiff_t>(fixed), plan.end(), condition),
      plan.end());
}

}  // namespace

SetupChoice::SetupChoice(const ScanPool& pool, const std::vector<SetupOfScan>& scans,
                         const CostModel& costs, const SetupLimits& limits)
    : pool_(pool), scans_(scans), costs_(costs), limits_(limits) {
  std::map<Setup, size_t> index;
  for (const SetupOfScan& scan : scans) {
    const Setup setup{scan.place, scan.rest};
    const auto [known, is_new] = index.try_emplace(setup, setups_.size());
    if (is_new) setups_.push_back(setup);
    setup_of_.push_back(known->second);
  }
}

std::set<SetupChoice::Setup> SetupChoice::SetupsOf(const PoolPlan& plan) const {
  std::set<Setup> setups;
  for (const size_t scan : plan) setups.insert(setups_[setup_of_[scan]]);
  return setups;
}

double SetupChoice::BetweenS(const Setup& a, const Setup& b) const {
  return (a.first != b.first ? costs_.move_sensors_time_s : 0) +
         (a.second != b.second ? costs_.lay_time_s : 0);
}

double SetupChoice::TourS(const std::set<Setup>& setups) const {
  if (setups.empty()) return 0;
  double best_s = kInfeasible_s;
  for (const Setup& start : setups) {
    std::vector<Setup> left(setups.begin(), setups.end());
    left.erase(std::find(left.begin(), left.end(), start));
    Setup here = start;
    double time_s = 0;
    while (!left.empty() && time_s < best_s) {
      const auto nearest = std::min_element(
          left.begin(), left.end(),
          [&](const auto& a, const auto& b) { return BetweenS(here, a) < BetweenS(here, b); });
      time_s += BetweenS(here, *nearest);
      here = *nearest;
      left.erase(nearest);
    }
    best_s = std::min(best_s, time_s);
  }
  return costs_.lay_time_s + costs_.move_sensors_time_s + best_s;
}

double SetupChoice::TimeS(const PoolPlan& plan) const {
  if (plan.empty()) return 0;
  const std::set<Setup> setups = SetupsOf(plan);
  double time_s = TourS(setups) +
                  costs_.turn_time_s * static_cast<double>(plan.size() - setups.size()) +
                  costs_.reposition_time_s.value_or(0) * static_cast<double>(plan.size() - 1);
  for (const size_t scan : plan) time_s += scans_[scan].scan_s;
  return time_s;
}

bool SetupChoice::KeepsLimits(const PoolPlan& plan) const {
  std::set<size_t> places, rests;
  for (const size_t scan : plan) {
    places.insert(scans_[scan].place);
    rests.insert(scans_[scan].rest);
  }
  const auto within = [](size_t count, const std::optional<int>& limit) {
    return !limit || count <= static_cast<size_t>(*limit);
  };
  return plan.size() <= limits_.scans && within(SetupsOf(plan).size(), limits_.setups) &&
         within(places.size(), limits_.places) && within(rests.size(), limits_.rests) &&
         (!limits_.time_s || TimeS(plan) <= *limits_.time_s);
}

std::vector<double> SetupChoice::AddedByEach(const PoolPlan& plan) const {
  const std::set<Setup> now = SetupsOf(plan);
  const double fixed_s = plan.empty() ? 0 : costs_.reposition_time_s.value_or(0);
  std::set<size_t> places, rests;
  for (const Setup& setup : now) {
    places.insert(setup.first);
    rests.insert(setup.second);
  }
  const auto full = [](size_t count, const std::optional<int>& limit) {
    return limit && count >= static_cast<size_t>(*limit);
  };
  std::vector<double> added_s;
  for (const Setup& setup : setups_) {
    if (now.contains(setup)) {
      added_s.push_back(costs_.turn_time_s + fixed_s);
    } else if (full(now.size(), limits_.setups) ||
               (!places.contains(setup.first) && full(places.size(), limits_.places)) ||
               (!rests.contains(setup.second) && full(rests.size(), limits_.rests))) {
      added_s.push_back(kInfeasible_s);
    } else {
      // Insert the set-up next to the nearest one of the plan.
      double change_s =
          now.empty() ? costs_.lay_time_s + costs_.move_sensors_time_s : kInfeasible_s;
      for (const Setup& other : now) change_s = std::min(change_s, BetweenS(other, setup));
      added_s.push_back(change_s + fixed_s);
    }
  }
  return added_s;
}

SetupChoice::Value SetupChoice::ValueOf(const PoolPlan& plan, double aim) const {
  return {std::min(pool_.Worth(plan), aim), TimeS(plan)};
}

bool SetupChoice::Better(const Value& a, const Value& b) {
  if (a.worth > b.worth + kEqualWorth) return true;
  return a.worth > b.worth - kEqualWorth && a.time_s < b.time_s - kEqualWorth;
}

void SetupChoice::Ruin(PoolPlan& plan, size_t fixed, Random& random,
                       std::optional<size_t>* without_place,
                       std::optional<size_t>* without_rest) const {
  if (plan.size() <= fixed) return;
  const auto any = [&] {
    return plan[fixed +
                static_cast<size_t>(random.Below(static_cast<int64_t>(plan.size() - fixed)))];
  };
  const SetupOfScan chosen = scans_[any()];
  switch (random.Below(6)) {
    case 0:
      *without_place = chosen.place;
      TakeOut(plan, fixed, [&](size_t scan) { return scans_[scan].place == chosen.place; });
      return;
    case 1:
      *without_rest = chosen.rest;
      TakeOut(plan, fixed, [&](size_t scan) { return scans_[scan].rest == chosen.rest; });
      return;
    case 2:
      TakeOut(plan, fixed, [&](size_t scan) {
        return scans_[scan].place == chosen.place && scans_[scan].rest == chosen.rest;
      });
      return;
    case 3:
      TakeOut(plan, fixed, [&](size_t scan) { return scans_[scan].place != chosen.place; });
      return;
    case 4: {
      // A random scan may bring in another place of the sensors.
      *without_place = chosen.place;
      TakeOut(plan, fixed, [&](size_t scan) { return scans_[scan].place == chosen.place; });
      PoolPlan with = plan;
      with.push_back(static_cast<size_t>(random.Below(static_cast<int64_t>(scans_.size()))));
      if (KeepsLimits(with)) plan = std::move(with);
      return;
    }
    default:
      for (int64_t removed = 1 + random.Below(3); removed > 0 && plan.size() > fixed; --removed) {
        plan.erase(std::find(plan.begin() + static_cast<std::ptrdiff_t>(fixed), plan.end(), any()));
      }
  }
}

void SetupChoice::Recreate(PoolPlan& plan, double aim, double extra_s,
                           std::optional<size_t> without_place,
                           std::optional<size_t> without_rest) const {
  double worth = pool_.Worth(plan);
  while (plan.size() < limits_.scans && worth < aim - kEqualWorth) {
    const std::vector<double> with = pool_.WorthWithEach(plan);
    const std::vector<double> added_s = AddedByEach(plan);
    const double left_s = limits_.time_s ? *limits_.time_s - TimeS(plan) : kInfeasible_s;
    double best_value = 0;
    size_t best = scans_.size();
    for (size_t scan = 0; scan < scans_.size(); ++scan) {
      if (scans_[scan].place == without_place || scans_[scan].rest == without_rest) continue;
      const double seconds = added_s[setup_of_[scan]] + scans_[scan].scan_s;
      if (!(seconds <= left_s) || seconds == kInfeasible_s) continue;
      const double gain = std::min(with[scan], aim) - worth;
      const double value = gain / std::max(1e-3, seconds + extra_s);
      if (gain > kEqualWorth && value > best_value) {
        best_value = value;
        best = scan;
      }
    }
    if (best == scans_.size()) return;
    plan.push_back(best);
    worth = with[best];
  }
}

void SetupChoice::Prune(PoolPlan& plan, size_t fixed, double aim) const {
  while (plan.size() > fixed) {
    const double time_s = TimeS(plan);
    double most_saved_s = -1;
    PoolPlan best;
    for (size_t place = fixed; place < plan.size(); ++place) {
      PoolPlan rest = plan;
      rest.erase(rest.begin() + static_cast<std::ptrdiff_t>(place));
      const double saved_s = time_s - TimeS(rest);
      if (saved_s <= most_saved_s || pool_.Worth(rest) < aim - kEqualWorth) continue;
      most_saved_s = saved_s;
      best = std::move(rest);
    }
    if (most_saved_s < 0) return;
    plan = std::move(best);
  }
}

PoolPlan SetupChoice::Improve(PoolPlan plan, size_t fixed, double aim, int rounds, Random& random,
                              const std::function<bool()>& stop) const {
  if (scans_.empty() || stop()) return plan;
  if (!KeepsLimits(plan)) {
    // Start from the fixed scans alone, with each extra time.
    PoolPlan best(plan.begin(), plan.begin() + static_cast<std::ptrdiff_t>(fixed));
    const PoolPlan start = best;
    for (const double extra_s : kExtra_s) {
      PoolPlan trial = start;
      Recreate(trial, aim, extra_s, std::nullopt, std::nullopt);
      if (Better(ValueOf(trial, aim), ValueOf(best, aim))) best = std::move(trial);
    }
    plan = std::move(best);
  }
  Prune(plan, fixed, aim);
  PoolPlan best = plan;
  Value now = ValueOf(plan, aim), best_value = now;
  for (int round = 0; round < rounds && !stop(); ++round) {
    PoolPlan trial = plan;
    std::optional<size_t> without_place, without_rest;
    Ruin(trial, fixed, random, &without_place, &without_rest);
    const auto extra = static_cast<size_t>(random.Below(static_cast<int64_t>(kExtra_s.size())));
    Recreate(trial, aim, kExtra_s[extra], without_place, without_rest);
    Prune(trial, fixed, aim);
    const Value value = ValueOf(trial, aim);
    Value tolerated = now;
    tolerated.time_s *= 1 + kLonger * (1 - static_cast<double>(round) / rounds);
    if (!Better(value, tolerated)) continue;
    plan = std::move(trial);
    now = value;
    if (Better(now, best_value)) {
      best_value = now;
      best = plan;
    }
  }
  return best;
}

}  // namespace sightline
