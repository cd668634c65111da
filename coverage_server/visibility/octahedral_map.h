// SPDX-License-Identifier: Apache-2.0
// Equal-count grid of directions on the sphere (octahedral map; Cigolle et al. 2014, "A survey of
// efficient representations for independent unit vectors", JCGT 3(2)).
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

namespace sightline {

// side x side cells; cell = row * side + column.
struct OctahedralMap {
  int side;

  int cells() const { return side * side; }

  // Unit vector through the centre of a cell.
  Eigen::Vector3f Direction(int cell) const {
    const int row = cell / side, column = cell % side;
    const float u = 2.0f * (static_cast<float>(column) + 0.5f) / static_cast<float>(side) - 1;
    const float v = 2.0f * (static_cast<float>(row) + 0.5f) / static_cast<float>(side) - 1;
    Eigen::Vector3f d(u, v, 1 - std::abs(u) - std::abs(v));
    if (d.z() < 0) {
      const float x = (1 - std::abs(v)) * (u < 0 ? -1.0f : 1.0f);
      const float y = (1 - std::abs(u)) * (v < 0 ? -1.0f : 1.0f);
      d = Eigen::Vector3f(x, y, d.z());
    }
    return d.normalized();
  }

  // Cell of a direction of any non-zero length.
  int Cell(const Eigen::Vector3f& d) const {
    const float scale = 1 / (std::abs(d.x()) + std::abs(d.y()) + std::abs(d.z()));
    float u = d.x() * scale, v = d.y() * scale;
    if (d.z() < 0) {
      const float folded_u = (1 - std::abs(v)) * (u < 0 ? -1.0f : 1.0f);
      const float folded_v = (1 - std::abs(u)) * (v < 0 ? -1.0f : 1.0f);
      u = folded_u;
      v = folded_v;
    }
    const float half = 0.5f * static_cast<float>(side);
    const int column = std::clamp(static_cast<int>((u + 1) * half), 0, side - 1);
    const int row = std::clamp(static_cast<int>((v + 1) * half), 0, side - 1);
    return row * side + column;
  }
};

}  // namespace sightline
