// SPDX-License-Identifier: Apache-2.0
#include "planner_client/strategy/scan_order.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
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

// Applies the best 2-opt (reversed stretch) or or-opt (stretch of up to three moved elsewhere)
// move until none helps.
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

double RepositionTimeS(const CostModel& costs, const Measurement& from, const Measurement& to) {
  const auto turn = [](double a, double b) {
    return std::abs(std::remainder(a - b, 2 * std::numbers::pi));
  };
  const double rotation_rad = std::max(
      {std::abs(from.triangulation_angle_rad - to.triangulation_angle_rad),
       std::abs(from.camera_polar_rad - to.camera_polar_rad),
       turn(from.camera_azimuth_rad, to.camera_azimuth_rad),
       turn(from.part_alpha_rad, to.part_alpha_rad), turn(from.part_beta_rad, to.part_beta_rad),
       turn(from.part_gamma_rad, to.part_gamma_rad)});
  const double translation_m = std::max({std::abs(from.camera_distance_m - to.camera_distance_m),
                                         std::abs(from.offset_y_m - to.offset_y_m),
                                         std::abs(from.offset_z_m - to.offset_z_m)});
  double moving_s = 0;
  if (costs.reposition_speed_rad_per_s) {
    moving_s = rotation_rad / *costs.reposition_speed_rad_per_s;
  }
  if (costs.reposition_speed_m_per_s) {
    moving_s = std::max(moving_s, translation_m / *costs.reposition_speed_m_per_s);
  }
  return costs.reposition_time_s.value_or(0) + moving_s;
}

double TotalRepositionTimeS(const CostModel& costs, std::span<const Measurement> scans,
                            std::span<const int> order) {
  double sum = 0;
  for (size_t i = 0; i + 1 < order.size(); ++i) {
    sum += RepositionTimeS(costs, scans[order[i]], scans[order[i + 1]]);
  }
  return sum;
}

std::vector<int> OrderScans(const CostModel& costs, std::span<const Measurement> scans,
                            int locked) {
  assert(locked >= 0 && locked <= static_cast<int>(scans.size()));
  std::vector<int> order(scans.size());
  std::iota(order.begin(), order.end(), 0);
  // A fixed time per move is the same in every order.
  const bool order_matters = costs.reposition_speed_rad_per_s || costs.reposition_speed_m_per_s;
  if (!order_matters || locked == static_cast<int>(scans.size())) return order;

  Times times(scans.size(), std::vector<double>(scans.size()));
  for (size_t i = 0; i < scans.size(); ++i) {
    for (size_t j = 0; j < scans.size(); ++j) {
      times[i][j] = RepositionTimeS(costs, scans[i], scans[j]);
    }
  }
  return OrderByMoveTimes(std::move(times), {}, locked);
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
