// SPDX-License-Identifier: Apache-2.0
#include "coverage_server/measurability/measurability.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace sightline {
namespace {

// Bit i is set if the ray from the point along directions[i] is free.
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

// Decides if a permitted exposure shows the line on a target.
class LightOnTarget {
 public:
  LightOnTarget(const DirectionLimits& limits, uint32_t triangle) : limits_(limits) {
    if (limits.light == nullptr || limits.light_map == nullptr) return;
    entry_ = limits.light->EntryOf(triangle);
  }

  // False if no pair that includes a direction with this cosine to the normal shows the line.
  bool MayShow(float cosine) const {
    if (entry_ == LightLimit::kUnlimited) return true;
    const LightMap& map = *limits_.light_map;
    const auto nearest_m =
        static_cast<float>(limits_.laser_distance_m.value_or(map.BinDistance(0)));
    return map.FarthestLaser(entry_, cosine) >= nearest_m;
  }
  // Cosines between the normal and two directions, and between these.
  bool Shows(float cos_a, float cos_b, float cos_between) const {
    if (entry_ == LightLimit::kUnlimited) return true;
    const LightMap& map = *limits_.light_map;
    for (int bin = 0; bin < map.bins(); ++bin) {
      const float camera_m = map.BinDistance(bin);
      const float laser_m = static_cast<float>(limits_.laser_distance_m.value_or(camera_m));
      if (map.Detects(entry_, camera_m, laser_m, cos_a, cos_b, cos_between) ||
          map.Detects(entry_, camera_m, laser_m, cos_b, cos_a, cos_between)) {
        return true;
      }
    }
    return false;
  }

 private:
  const DirectionLimits& limits_;
  int16_t entry_ = LightLimit::kUnlimited;
};

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
  // A map twice as fine has directions between those of the field.
  const OctahedralMap fine{2 * map.side};
  std::vector<Eigen::Vector3f> fine_directions(fine.cells());
  for (int c = 0; c < fine.cells(); ++c) fine_directions[c] = fine.Direction(c);
  std::vector<int> candidates, refined, open;

  // True if a pair of open cells has a permitted angle between its directions and shows the line.
  const auto has_open_pair =
      [&](const Eigen::Vector3f& from, const Eigen::Vector3f& normal, const LightOnTarget& light,
          const std::vector<Eigen::Vector3f>& all, const std::vector<int>& asked) {
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
              if (cosine <= cos_min && cosine >= cos_max &&
                  light.Shows(normal.dot(all[cells[k]]), normal.dot(all[other]), cosine)) {
                return true;
              }
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
    const LightOnTarget light(limits, targets.triangles.empty() ? 0 : targets.triangles[t]);
    candidates.clear();
    for (int c = 0; c < map.cells(); ++c) {
      const float cosine = normal.dot(directions[c]);
      if (field.Probes(t, c) != 0 && cosine > least_cosine && light.MayShow(cosine)) {
        candidates.push_back(c);
      }
    }
    bool found = has_open_pair(from, normal, light, directions, candidates);
    if (!found) {
      refined.clear();
      for (const int c : candidates) {
        for (int i = 0; i < 4; ++i) {
          const int row = 2 * (c / map.side) + i / 2, column = 2 * (c % map.side) + i % 2;
          const float cosine = normal.dot(fine_directions[row * fine.side + column]);
          if (cosine > least_cosine && light.MayShow(cosine)) {
            refined.push_back(row * fine.side + column);
          }
        }
      }
      found = has_open_pair(from, normal, light, fine_directions, refined);
    }
    if (found) measurable.Set(t);
  }
}

}  // namespace sightline
