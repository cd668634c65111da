// SPDX-License-Identifier: Apache-2.0
#include "coverage_server/scan/target_lookup.h"

#include <algorithm>

namespace sightline {

TargetLookup::TargetLookup(const TargetSet& targets, const TargetSampling& sampling)
    : targets_(targets) {
  const float radius = static_cast<float>(sampling.coverage_radius_m);
  radius_squared_ = radius * radius;
  cos_gate_ = static_cast<float>(std::cos(sampling.max_normal_angle_rad));
  Eigen::AlignedBox3f box;
  for (const auto& p : targets.positions_m) box.extend(p);
  const Eigen::Vector3f extent = box.sizes() + Eigen::Vector3f::Constant(2.1f * radius);
  origin_ = box.min() - Eigen::Vector3f::Constant(1.05f * radius);
  constexpr double kMaxCells = 8e6;
  const double volume = static_cast<double>(extent.x()) * extent.y() * extent.z();
  const float cell = std::max(0.5f * radius, static_cast<float>(std::cbrt(volume / kMaxCells)));
  inverse_cell_ = 1 / cell;
  for (int k = 0; k < 3; ++k) size_[k] = static_cast<size_t>(extent[k] * inverse_cell_) + 1;

  // Two passes: count, then fill.
  starts_.assign(size_[0] * size_[1] * size_[2] + 1, 0);
  const auto visit_cells = [&](size_t t, const auto& visit) {
    const Eigen::Vector3f p = targets.positions_m[t];
    size_t low[3], high[3];
    for (int k = 0; k < 3; ++k) {
      low[k] = static_cast<size_t>(std::max(0.0f, (p[k] - radius - origin_[k]) * inverse_cell_));
      high[k] =
          std::min(size_[k] - 1, static_cast<size_t>((p[k] + radius - origin_[k]) * inverse_cell_));
    }
    for (size_t z = low[2]; z <= high[2]; ++z) {
      for (size_t y = low[1]; y <= high[1]; ++y) {
        for (size_t x = low[0]; x <= high[0]; ++x) {
          const Eigen::Vector3f a =
              origin_ + cell * Eigen::Vector3f(static_cast<float>(x), static_cast<float>(y),
                                               static_cast<float>(z));
          const Eigen::AlignedBox3f cell_box(a, a + Eigen::Vector3f::Constant(cell));
          if (cell_box.squaredExteriorDistance(p) <= radius_squared_ * 1.0001f) {
            visit((z * size_[1] + y) * size_[0] + x);
          }
        }
      }
    }
  };
  for (size_t t = 0; t < targets.size(); ++t) {
    visit_cells(t, [&](size_t index) { ++starts_[index + 1]; });
  }
  for (size_t i = 1; i < starts_.size(); ++i) starts_[i] += starts_[i - 1];
  entries_.resize(starts_.back());
  std::vector<uint32_t> next(starts_.begin(), starts_.end() - 1);
  for (size_t t = 0; t < targets.size(); ++t) {
    visit_cells(t, [&](size_t index) { entries_[next[index]++] = static_cast<uint32_t>(t); });
  }
}

}  // namespace sightline
