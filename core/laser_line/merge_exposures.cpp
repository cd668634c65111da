// SPDX-License-Identifier: Apache-2.0
#include "core/laser_line/merge_exposures.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <tuple>

namespace sightline {
namespace {

bool IsNear(const LinePoint& point, std::span<const LinePoint> others, double apart_px) {
  return std::any_of(others.begin(), others.end(), [&](const LinePoint& other) {
    return std::abs(other.row_px - point.row_px) <= apart_px;
  });
}

}  // namespace

std::vector<LinePoint> MergeExposures(const std::vector<LinePoint>& long_exposure,
                                      const std::vector<LinePoint>& short_exposure,
                                      double apart_px) {
  const auto column_of = [](const std::vector<LinePoint>& points, int column) {
    const auto [begin, end] = std::equal_range(
        points.begin(), points.end(), LinePoint{.column_px = column},
        [](const LinePoint& a, const LinePoint& b) { return a.column_px < b.column_px; });
    return std::span<const LinePoint>(begin, end);
  };
  std::vector<LinePoint> merged;
  // Unclipped ones of the long exposure first; they are the most exact.
  for (const LinePoint& point : long_exposure) {
    if (!point.saturated) merged.push_back(point);
  }
  const std::vector<LinePoint> exact = merged;
  std::vector<LinePoint> second;
  for (const LinePoint& point : short_exposure) {
    if (!IsNear(point, column_of(exact, point.column_px), apart_px)) second.push_back(point);
  }
  merged.insert(merged.end(), second.begin(), second.end());
  for (const LinePoint& point : long_exposure) {
    if (point.saturated && !IsNear(point, column_of(second, point.column_px), apart_px) &&
        !IsNear(point, column_of(exact, point.column_px), apart_px)) {
      merged.push_back(point);
    }
  }
  std::sort(merged.begin(), merged.end(), [](const LinePoint& a, const LinePoint& b) {
    return std::tie(a.column_px, a.row_px) < std::tie(b.column_px, b.row_px);
  });
  return merged;
}

}  // namespace sightline
