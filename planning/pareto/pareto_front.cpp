// SPDX-License-Identifier: Apache-2.0
#include "planning/pareto/pareto_front.h"

#include <algorithm>
#include <tuple>
#include <utility>

namespace sightline {
namespace {

// Objectives to minimise, in lexicographic order.
std::tuple<size_t, double, int64_t> Objectives(const ParetoPoint& point) {
  return {point.scans.size(), point.time.Total_s(), -point.Claimed()};
}

}  // namespace

bool Dominates(const ParetoPoint& a, const ParetoPoint& b) {
  const auto [scans_a, time_a, settled_a] = Objectives(a);
  const auto [scans_b, time_b, settled_b] = Objectives(b);
  return scans_a <= scans_b && time_a <= time_b && settled_a <= settled_b &&
         Objectives(a) != Objectives(b);
}

ParetoFront FrontOf(std::vector<ParetoPoint> found) {
  std::erase_if(found, [](const ParetoPoint& point) { return point.scans.empty(); });
  std::vector<bool> dominated(found.size(), false), repeated(found.size(), false);
  for (size_t i = 0; i < found.size(); ++i) {
    for (size_t j = 0; j < found.size(); ++j) {
      dominated[i] = dominated[i] || Dominates(found[j], found[i]);
      repeated[i] = repeated[i] || (j < i && Objectives(found[j]) == Objectives(found[i]));
    }
  }
  ParetoFront front;
  for (size_t i = 0; i < found.size(); ++i) {
    if (repeated[i]) continue;
    (dominated[i] ? front.dominated : front.points).push_back(std::move(found[i]));
  }
  std::stable_sort(
      front.points.begin(), front.points.end(),
      [](const ParetoPoint& a, const ParetoPoint& b) { return Objectives(a) < Objectives(b); });
  return front;
}

std::optional<size_t> PointForGoal(const std::vector<ParetoPoint>& points) {
  std::optional<size_t> best;
  for (size_t i = 0; i < points.size(); ++i) {
    if (!best) {
      best = i;
      continue;
    }
    const ParetoPoint &point = points[i], &other = points[*best];
    if (point.reaches_goal != other.reaches_goal) {
      if (point.reaches_goal) best = i;
    } else if (point.reaches_goal) {
      if (Objectives(point) < Objectives(other)) best = i;
    } else if (point.Claimed() > other.Claimed()) {
      best = i;
    }
  }
  return best;
}

}  // namespace sightline
