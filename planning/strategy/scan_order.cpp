// SPDX-License-Identifier: Apache-2.0
#include "planning/strategy/scan_order.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>

namespace sightline {

namespace {

constexpr int kMaxExact = 12;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

using Times = std::vector<std::vector<double>>;

// `start`: index of the scan before the free ones, -1: none.
std::vector<int> BestOrderExactly(const Times& times, const std::vector<int>& free, int start) {
  const size_t n = free.size();
  const size_t sets = size_t{1} << n;
  std::vector<double> least(sets * n, kInfinity);
  std::vector<int> previous(sets * n, -1);
  for (size_t i = 0; i < n; ++i) {
    least[(size_t{1} << i) * n + i] = start < 0 ? 0 : times[start][free[i]];
  }
  for (size_t set = 1; set < sets; ++set) {
    for (size_t last = 0; last < n; ++last) {
      const double here = least[set * n + last];
      if (here == kInfinity) continue;
      for (size_t next = 0; next < n; ++next) {
        if (set >> next & 1) continue;
        const size_t index = (set | size_t{1} << next) * n + next;
        const double there = here + times[free[last]][free[next]];
        if (there < least[index]) {
          least[index] = there;
          previous[index] = static_cast<int>(last);
        }
      }
    }
  }
  size_t set = sets - 1;
  int last =
      static_cast<int>(std::min_element(least.end() - static_cast<std::ptrdiff_t>(n), least.end()) -
                       (least.end() - static_cast<std::ptrdiff_t>(n)));
  std::vector<int> order;
  while (last >= 0) {
    order.push_back(free[last]);
    const int before = previous[set * n + static_cast<size_t>(last)];
    set ^= size_t{1} << last;
    last = before;
  }
  std::reverse(order.begin(), order.end());
  return order;
}

double PathTime(const Times& times, const std::vector<int>& order, int start) {
  double sum = start < 0 || order.empty() ? 0 : times[start][order[0]];
  for (size_t i = 0; i + 1 < order.size(); ++i) sum += times[order[i]][order[i + 1]];
  return sum;
}

// Applies the best 2-opt move (reverse a segment) or or-opt move (move a segment of up to three)
// until none helps.
void ImproveOrder(const Times& times, std::vector<int>& order, int start) {
  const size_t n = order.size();
  while (true) {
    std::vector<int> best = order;
    double best_time = PathTime(times, order, start) - 1e-12;
    const auto consider = [&](std::vector<int> trial) {
      if (const double time = PathTime(times, trial, start); time < best_time) {
        best_time = time;
        best = std::move(trial);
      }
    };
    for (size_t i = 0; i < n; ++i) {
      for (size_t j = i + 2; j <= n; ++j) {
        std::vector<int> trial = order;
        std::reverse(trial.begin() + static_cast<std::ptrdiff_t>(i),
                     trial.begin() + static_cast<std::ptrdiff_t>(j));
        consider(std::move(trial));
      }
      for (size_t length = 1; length <= 3 && i + length <= n; ++length) {
        const auto first = order.begin() + static_cast<std::ptrdiff_t>(i);
        const std::vector<int> stretch(first, first + static_cast<std::ptrdiff_t>(length));
        std::vector<int> rest = order;
        rest.erase(rest.begin() + static_cast<std::ptrdiff_t>(i),
                   rest.begin() + static_cast<std::ptrdiff_t>(i + length));
        for (size_t k = 0; k <= rest.size(); ++k) {
          std::vector<int> trial = rest;
          trial.insert(trial.begin() + static_cast<std::ptrdiff_t>(k), stretch.begin(),
                       stretch.end());
          consider(std::move(trial));
        }
      }
    }
    if (best == order) return;
    order = std::move(best);
  }
}

std::vector<int> GoodOrder(const Times& times, const std::vector<int>& free, int start) {
  std::vector<int> best;
  double best_time = kInfinity;
  for (int first : free) {
    std::vector<int> order = {first};
    std::vector<int> left = free;
    std::erase(left, first);
    while (!left.empty()) {
      const int here = order.back();
      const auto nearest = std::min_element(
          left.begin(), left.end(), [&](int a, int b) { return times[here][a] < times[here][b]; });
      order.push_back(*nearest);
      left.erase(nearest);
    }
    ImproveOrder(times, order, start);
    if (const double time = PathTime(times, order, start); time < best_time) {
      best_time = time;
      best = std::move(order);
    }
  }
  return best;
}

}  // namespace

double ScanTimeS(const CostModel& costs, double scan_step_m, int first_frame, int last_frame) {
  if (last_frame < first_frame) return 0;
  double speed_m_per_s = kInfinity;
  if (costs.stage_speed_m_per_s) speed_m_per_s = *costs.stage_speed_m_per_s;
  if (costs.frame_rate_hz) {
    speed_m_per_s = std::min(speed_m_per_s, *costs.frame_rate_hz * scan_step_m);
  }
  return (last_frame - first_frame) * scan_step_m / speed_m_per_s;
}

double RepositionTimeS(const ExecutionModel& model, const Measurement& from,
                       const Measurement& to) {
  return TimesBetween(model, from, to).Total_s();
}

double TotalRepositionTimeS(const ExecutionModel& model, std::span<const Measurement> scans,
                            std::span<const int> order) {
  double sum = 0;
  for (size_t i = 0; i + 1 < order.size(); ++i) {
    sum += RepositionTimeS(model, scans[order[i]], scans[order[i + 1]]);
  }
  return sum;
}

namespace {

Times TimesBetweenAll(const ExecutionModel& model, std::span<const Measurement> scans) {
  Times times(scans.size(), std::vector<double>(scans.size()));
  for (size_t i = 0; i < scans.size(); ++i) {
    for (size_t j = 0; j < scans.size(); ++j) {
      times[i][j] = RepositionTimeS(model, scans[i], scans[j]);
    }
  }
  return times;
}

// Scans from `locked` on that share a set-up, in the order of their first scans.
std::vector<std::vector<int>> SetupGroups(const ExecutionModel& model,
                                          std::span<const Measurement> scans, int locked) {
  std::vector<std::vector<int>> groups;
  for (int i = locked; i < static_cast<int>(scans.size()); ++i) {
    const auto same = std::find_if(groups.begin(), groups.end(), [&](const auto& group) {
      const Measurement& first = scans[static_cast<size_t>(group.front())];
      return SameRest(model, first, scans[static_cast<size_t>(i)]) &&
             SamePlaceOfSensors(model, first, scans[static_cast<size_t>(i)]);
    });
    if (same == groups.end()) {
      groups.push_back({i});
    } else {
      same->push_back(i);
    }
  }
  return groups;
}

// Shortest move time from any scan of one group to any of the other.
double BetweenGroups(const Times& times, const std::vector<int>& from, const std::vector<int>& to) {
  double least_s = kInfinity;
  for (const int i : from) {
    for (const int j : to) least_s = std::min(least_s, times[i][j]);
  }
  return least_s;
}

// Orders the set-ups, then the scans within each.
std::vector<int> OrderBySetups(const ExecutionModel& model, std::span<const Measurement> scans,
                               int locked) {
  const Times times = TimesBetweenAll(model, scans);
  const std::vector<std::vector<int>> groups = SetupGroups(model, scans, locked);
  const std::vector<int> before = {locked - 1};
  Times between(groups.size(), std::vector<double>(groups.size()));
  std::vector<double> first;
  for (size_t i = 0; i < groups.size(); ++i) {
    for (size_t j = 0; j < groups.size(); ++j) {
      between[i][j] = BetweenGroups(times, groups[i], groups[j]);
    }
    if (locked > 0) first.push_back(BetweenGroups(times, before, groups[i]));
  }
  std::vector<int> order(static_cast<size_t>(locked));
  std::iota(order.begin(), order.end(), 0);
  for (const int g : OrderByMoveTimes(std::move(between), first, 0)) {
    const std::vector<int>& group = groups[static_cast<size_t>(g)];
    Times inside(group.size(), std::vector<double>(group.size()));
    std::vector<double> from_last;
    for (size_t i = 0; i < group.size(); ++i) {
      for (size_t j = 0; j < group.size(); ++j) inside[i][j] = times[group[i]][group[j]];
      if (!order.empty()) from_last.push_back(times[order.back()][group[i]]);
    }
    for (const int i : OrderByMoveTimes(std::move(inside), from_last, 0)) {
      order.push_back(group[static_cast<size_t>(i)]);
    }
  }
  return order;
}

}  // namespace

std::vector<int> OrderScans(const ExecutionModel& model, std::span<const Measurement> scans,
                            int locked) {
  assert(locked >= 0 && locked <= static_cast<int>(scans.size()));
  const CostModel& costs = model.costs;
  std::vector<int> order(scans.size());
  std::iota(order.begin(), order.end(), 0);
  if (locked == static_cast<int>(scans.size())) return order;
  if (costs.PricesSetups()) {
    std::vector<int> by_setups = OrderBySetups(model, scans, locked);
    if (static_cast<int>(scans.size()) - locked > kMaxExact) return by_setups;
    // Two set-ups may share a turn of the part, which the order of set-ups ignores.
    std::vector<int> exact = OrderByMoveTimes(TimesBetweenAll(model, scans), {}, locked);
    const double less_s =
        TotalRepositionTimeS(model, scans, by_setups) - TotalRepositionTimeS(model, scans, exact);
    return less_s > 1e-9 ? exact : by_setups;
  }
  // A fixed time per move is the same in every order, so only other times matter.
  const bool order_matters =
      costs.reposition_speed_rad_per_s || costs.reposition_speed_m_per_s || costs.turn_time_s > 0;
  if (!order_matters) return order;
  return OrderByMoveTimes(TimesBetweenAll(model, scans), {}, locked);
}

std::vector<int> OrderByMoveTimes(Times times, std::span<const double> first, int locked) {
  assert(locked >= 0 && locked <= static_cast<int>(times.size()));
  assert(first.empty() || first.size() == times.size());
  std::vector<int> order(times.size());
  std::iota(order.begin(), order.end(), 0);
  if (locked == static_cast<int>(times.size())) return order;
  const std::vector<int> free(order.begin() + locked, order.end());
  int start = locked - 1;
  if (start < 0 && !first.empty()) {
    start = static_cast<int>(times.size());
    times.emplace_back(first.begin(), first.end());
  }
  const std::vector<int> best = static_cast<int>(free.size()) <= kMaxExact
                                    ? BestOrderExactly(times, free, start)
                                    : GoodOrder(times, free, start);
  std::copy(best.begin(), best.end(), order.begin() + locked);
  return order;
}

}  // namespace sightline
