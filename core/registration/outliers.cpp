// SPDX-License-Identifier: Apache-2.0
#include "core/registration/outliers.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <utility>

namespace sightline {
namespace {

constexpr size_t kFewestNeighbours = 5;
constexpr int kSizesOfCells = 3;

using CellKey = std::array<int32_t, 3>;

CellKey KeyOf(const Eigen::Vector3f& position_m, double cell_m) {
  CellKey key{};
  for (int axis = 0; axis < 3; ++axis) {
    key[static_cast<size_t>(axis)] =
        static_cast<int32_t>(std::floor(static_cast<double>(position_m[axis]) / cell_m));
  }
  return key;
}

float MedianOf(std::vector<float>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// Marks the outliers of one cube.
void JudgeCell(std::span<const uint32_t> members, const PointsOnModel& points,
               const ScanNoise& noise, double most_deviations, std::vector<uint8_t>& outliers) {
  std::vector<float> values;
  for (const uint32_t p : members) values.push_back(points.deviations_m[p]);
  const float median_m = MedianOf(values);
  for (float& value : values) value = std::abs(value - median_m);
  const double spread_m = 1.4826 * static_cast<double>(MedianOf(values));
  const uint32_t first = members.front();
  const Eigen::Vector3d normal = points.normals[first].cast<double>();
  const double variance_m2 =
      noise.DetectionVariance(points.positions_m[first].cast<double>(), normal, normal);
  const double noise_m = std::isfinite(variance_m2) ? std::sqrt(variance_m2) : 0;
  const double most_m = most_deviations * std::max(spread_m, noise_m);
  for (const uint32_t p : members) {
    outliers[p] = std::abs(static_cast<double>(points.deviations_m[p] - median_m)) > most_m;
  }
}

}  // namespace

std::vector<uint8_t> FindOutliers(const PointsOnModel& points, const ScanNoise& noise,
                                  const OutlierRule& rule) {
  std::vector<uint8_t> outliers(points.positions_m.size(), 0);
  std::vector<uint32_t> open(points.positions_m.size());
  std::iota(open.begin(), open.end(), 0u);
  double cell_m = rule.cell_m;
  for (int size = 0; size < kSizesOfCells && !open.empty(); ++size, cell_m *= 2) {
    // Cubes are filled with all points, also where only few of them are still to be judged.
    std::vector<std::pair<CellKey, uint32_t>> placed(points.positions_m.size());
    for (size_t p = 0; p < placed.size(); ++p) {
      placed[p] = {KeyOf(points.positions_m[p], cell_m), static_cast<uint32_t>(p)};
    }
    std::sort(placed.begin(), placed.end());
    std::vector<uint8_t> to_judge(points.positions_m.size(), 0);
    for (const uint32_t p : open) to_judge[p] = 1;
    open.clear();
    std::vector<uint32_t> members;
    std::vector<uint8_t> judged(outliers);
    for (size_t begin = 0; begin < placed.size();) {
      size_t end = begin;
      members.clear();
      bool any = false;
      while (end < placed.size() && placed[end].first == placed[begin].first) {
        members.push_back(placed[end].second);
        any = any || to_judge[placed[end].second] != 0;
        ++end;
      }
      begin = end;
      if (!any) continue;
      if (members.size() < kFewestNeighbours) {
        for (const uint32_t p : members) {
          if (to_judge[p] != 0) open.push_back(p);
        }
        continue;
      }
      JudgeCell(members, points, noise, rule.most_deviations, judged);
      for (const uint32_t p : members) {
        if (to_judge[p] != 0) outliers[p] = judged[p];
      }
    }
  }
  return outliers;
}

int64_t RemovePoints(std::span<const uint8_t> marked, PointsOnModel& points) {
  size_t kept = 0;
  for (size_t p = 0; p < marked.size(); ++p) {
    if (marked[p] != 0) continue;
    points.positions_m[kept] = points.positions_m[p];
    points.normals[kept] = points.normals[p];
    points.deviations_m[kept] = points.deviations_m[p];
    points.distances_m[kept] = points.distances_m[p];
    points.sure[kept] = points.sure[p];
    ++kept;
  }
  const auto removed = static_cast<int64_t>(marked.size() - kept);
  points.positions_m.resize(kept);
  points.normals.resize(kept);
  points.deviations_m.resize(kept);
  points.distances_m.resize(kept);
  points.sure.resize(kept);
  return removed;
}

std::vector<uint8_t> FindDuplicates(std::span<const Eigen::Vector3d> positions_m) {
  std::vector<uint32_t> order(positions_m.size());
  std::iota(order.begin(), order.end(), 0u);
  const auto compare = [&](uint32_t a, uint32_t b) {
    const Eigen::Vector3d &p = positions_m[a], &q = positions_m[b];
    for (int axis = 0; axis < 3; ++axis) {
      if (p[axis] != q[axis]) return p[axis] < q[axis];
    }
    return a < b;
  };
  std::sort(order.begin(), order.end(), compare);
  std::vector<uint8_t> duplicates(positions_m.size(), 0);
  for (size_t i = 1; i < order.size(); ++i) {
    duplicates[order[i]] = positions_m[order[i]] == positions_m[order[i - 1]];
  }
  return duplicates;
}

}  // namespace sightline
