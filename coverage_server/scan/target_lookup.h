// SPDX-License-Identifier: Apache-2.0
// Finds the targets that a measurement point covers.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "core/targets/target_set.h"

namespace sightline {

// Grid whose cells list every target within the coverage radius of any point of the cell.
class TargetLookup {
 public:
  TargetLookup(const TargetSet& targets, const TargetSampling& sampling);

  // Sets the bits of the targets within the coverage radius of a point: in `near` all, in `covered`
  // those whose normal passes the gate.
  void Mark(const Eigen::Vector3f& point, const Eigen::Vector3f& normal, TargetBits& covered,
            TargetBits& near) const {
    const Eigen::Vector3f cell = (point - origin_) * inverse_cell_;
    if ((cell.array() < 0).any()) return;
    const auto i = static_cast<size_t>(cell.x()), j = static_cast<size_t>(cell.y()),
               k = static_cast<size_t>(cell.z());
    if (i >= size_[0] || j >= size_[1] || k >= size_[2]) return;
    const size_t index = (k * size_[1] + j) * size_[0] + i;
    for (uint32_t e = starts_[index]; e < starts_[index + 1]; ++e) {
      const uint32_t t = entries_[e];
      if ((targets_.positions_m[t] - point).squaredNorm() > radius_squared_) continue;
      near.Set(t);
      if (targets_.normals[t].dot(normal) >= cos_gate_) covered.Set(t);
    }
  }

  size_t bytes() const { return starts_.capacity() * 4 + entries_.capacity() * 4; }

 private:
  const TargetSet& targets_;
  float radius_squared_, cos_gate_, inverse_cell_;
  Eigen::Vector3f origin_;
  size_t size_[3];
  std::vector<uint32_t> starts_, entries_;
};

}  // namespace sightline
