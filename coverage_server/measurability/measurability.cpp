// SPDX-License-Identifier: Apache-2.0
#include "coverage_server/measurability/measurability.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace sightline {
namespace {

// Bit i: nothing between the point and infinity along directions[i].
uint32_t OpenDirections(const std::vector<Occluder>& occluders, const Eigen::Vector3f& from,
                        const std::vector<Eigen::Vector3f>& directions, const int* cells,
                        int count) {
  uint32_t open = (1u << count) - 1;
  for (const Occluder& occluder : occluders) {
    if (occluder.frame != ObstacleFrame::kPart) continue;
    const float far =
        2 * occluder.bvh.bounds().sizes().norm() + (occluder.bvh.bounds().center() - from).norm();
    TriangleBvh::Bundle bundle;
    for (int k = 0; k < TriangleBvh::kLanes; ++k) {
      const Eigen::Vector3f to = from + far * directions[cells[std::min(k, count - 1)]];
      bundle.to_x[k] = to.x();
      bundle.to_y[k] = to.y();
      bundle.to_z[k] = to.z();
      bundle.gap[k] = 0;
    }
    open &= ~occluder.bvh.Occluded(from, bundle, open);
  }
  return open;
}

}  // namespace

void MarkMeasurable(const TargetSet& targets, const VisibilityField& field,
                    const std::vector<Occluder>& occluders, const DirectionLimits& limits,
                    size_t begin, size_t end, TargetBits& measurable,
                    const std::atomic<bool>* cancelled) {
  const OctahedralMap& map = field.map();
  std::vector<Eigen::Vector3f> directions(map.cells());
  for (int c = 0; c < map.cells(); ++c) directions[c] = map.Direction(c);
  const float cos_min = static_cast<float>(std::cos(limits.min_angle_rad));
  const float cos_max = static_cast<float>(std::cos(limits.max_angle_rad));
  const auto least_cosine = static_cast<float>(limits.min_cos_incidence);
  // Between the field's directions lie those of a map twice as fine.
  const OctahedralMap fine{2 * map.side};
  std::vector<Eigen::Vector3f> fine_directions(fine.cells());
  for (int c = 0; c < fine.cells(); ++c) fine_directions[c] = fine.Direction(c);
  std::vector<int> candidates, refined, open;

  // Some pair of the cells is open and far enough apart, but not too far.
  const auto has_open_pair = [&](const Eigen::Vector3f& from,
                                 const std::vector<Eigen::Vector3f>& all,
                                 const std::vector<int>& asked) {
    open.clear();
    // Cells far apart first: open targets are decided by their first bundle or two.
    const size_t bundles = (asked.size() + TriangleBvh::kLanes - 1) / TriangleBvh::kLanes;
    for (size_t b = 0; b < bundles; ++b) {
      int cells[TriangleBvh::kLanes];
      int count = 0;
      for (size_t i = b; i < asked.size() && count < TriangleBvh::kLanes; i += bundles)
        cells[count++] = asked[i];
      const uint32_t bits = OpenDirections(occluders, from, all, cells, count);
      for (int k = 0; k < count; ++k) {
        if (!((bits >> k) & 1)) continue;
        for (const int other : open) {
          const float cosine = all[cells[k]].dot(all[other]);
          if (cosine <= cos_min && cosine >= cos_max) return true;
        }
        open.push_back(cells[k]);
      }
    }
    return false;
  };

  // Lifted off its own surface.
  constexpr float kLiftM = 2e-5f;
  for (size_t t = begin; t < end; ++t) {
    if (cancelled != nullptr && cancelled->load(std::memory_order_relaxed)) return;
    const Eigen::Vector3f normal = targets.normals[t],
                          from = targets.positions_m[t] + kLiftM * normal;
    candidates.clear();
    for (int c = 0; c < map.cells(); ++c) {
      if (field.Probes(t, c) != 0 && normal.dot(directions[c]) > least_cosine)
        candidates.push_back(c);
    }
    bool found = has_open_pair(from, directions, candidates);
    if (!found) {
      refined.clear();
      for (const int c : candidates) {
        for (int i = 0; i < 4; ++i) {
          const int row = 2 * (c / map.side) + i / 2, column = 2 * (c % map.side) + i % 2;
          if (normal.dot(fine_directions[row * fine.side + column]) > least_cosine)
            refined.push_back(row * fine.side + column);
        }
      }
      found = has_open_pair(from, fine_directions, refined);
    }
    if (found) measurable.Set(t);
  }
}

}  // namespace sightline
