#include "coverage_server/visibility/measurability.h"

#include <cmath>
#include <vector>

namespace sightline {

void MarkMeasurable(const TargetSet& targets, const VisibilityField& field, double min_angle_rad,
                    double max_angle_rad, size_t begin, size_t end, TargetBits& measurable) {
  const OctahedralMap& map = field.map();
  std::vector<Eigen::Vector3f> directions(map.cells());
  for (int c = 0; c < map.cells(); ++c) directions[c] = map.Direction(c);
  const float cos_min = static_cast<float>(std::cos(min_angle_rad));
  const float cos_max = static_cast<float>(std::cos(max_angle_rad));
  std::vector<int> seen;
  for (size_t t = begin; t < end; ++t) {
    seen.clear();
    for (int c = 0; c < map.cells(); ++c) {
      if ((field.Probes(t, c) & 1) && targets.normals[t].dot(directions[c]) > 0) seen.push_back(c);
    }
    bool found = false;
    for (size_t i = 0; i < seen.size() && !found; ++i) {
      for (size_t j = i + 1; j < seen.size() && !found; ++j) {
        const float cosine = directions[seen[i]].dot(directions[seen[j]]);
        found = cosine <= cos_min && cosine >= cos_max;
      }
    }
    if (found) measurable.Set(t);
  }
}

}  // namespace sightline
