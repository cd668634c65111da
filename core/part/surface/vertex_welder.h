// SPDX-License-Identifier: Apache-2.0
// Welding of vertices that coincide within a tolerance.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <random>
#include <vector>

namespace sightline {

// Numbers vertices by position, in the order in which they are added. Positions that differ by no
// more than the tolerance in every coordinate are one vertex: exporters write the same corner once
// as 0 and once as 1e-9, and an exact comparison would tear the surface there.
class VertexWelder {
 public:
  static constexpr uint32_t kNone = std::numeric_limits<uint32_t>::max();

  // `tolerance_m`: at least 2^-24 of the largest coordinate.
  VertexWelder(float tolerance_m, std::vector<Eigen::Vector3f>* positions)
      : positions_(*positions), tolerance_m_(tolerance_m), table_(1 << 10) {}

  // The first vertex within the tolerance of a position; kNone if there is none.
  uint32_t Find(const Eigen::Vector3f& position) const {
    const Cell low = CellOf(position.array() - tolerance_m_);
    const Cell high = CellOf(position.array() + tolerance_m_);
    uint32_t found = kNone;
    for (int32_t x = low[0]; x <= high[0]; ++x) {
      for (int32_t y = low[1]; y <= high[1]; ++y) {
        for (int32_t z = low[2]; z <= high[2]; ++z) {
          const Slot& slot = table_[SlotOf({x, y, z})];
          for (uint32_t i = slot.first; i != kNone; i = next_[i]) {
            const bool near = (positions_[i] - position).cwiseAbs().maxCoeff() <= tolerance_m_;
            if (near) found = std::min(found, i);
          }
        }
      }
    }
    return found;
  }

  // The same, or a new vertex.
  uint32_t Add(const Eigen::Vector3f& position) {
    const uint32_t found = Find(position);
    if (found != kNone) return found;
    if (2 * used_ >= table_.size()) Grow();
    const Cell cell = CellOf(position);
    Slot& slot = table_[SlotOf(cell)];
    const uint32_t index = static_cast<uint32_t>(positions_.size());
    used_ += slot.first == kNone;
    next_.push_back(slot.first);
    slot = {cell, index};
    positions_.push_back(position);
    return index;
  }

 private:
  using Cell = std::array<int32_t, 3>;  // within 2^20 of zero
  struct Slot {
    Cell cell{};
    uint32_t first = kNone;  // kNone: free
  };

  // Cells much wider than the tolerance: nearly always one is enough to look at.
  Cell CellOf(const Eigen::Vector3f& p) const {
    Cell cell;
    for (int axis = 0; axis < 3; ++axis) {
      cell[axis] = static_cast<int32_t>(std::floor(p[axis] / (16.0 * tolerance_m_)));
    }
    return cell;
  }
  size_t SlotOf(const Cell& cell) const {
    uint64_t hash = 0;  // 20 bits for each axis
    for (const int32_t c : cell) hash = (hash << 20) | (static_cast<uint32_t>(c) & 0xfffffu);
    hash += seed_;
    // Finalizer of SplitMix64 (Steele, Lea, Flood 2014).
    hash = (hash ^ (hash >> 30)) * 0xbf58476d1ce4e5b9u;
    hash = (hash ^ (hash >> 27)) * 0x94d049bb133111ebu;
    hash ^= hash >> 31;
    const size_t mask = table_.size() - 1;
    size_t slot = hash & mask;
    while (table_[slot].first != kNone && table_[slot].cell != cell) slot = (slot + 1) & mask;
    return slot;
  }
  // Grows on demand, because the number of distinct vertices is known only at the end.
  void Grow() {
    std::vector<Slot> old(2 * table_.size());
    old.swap(table_);
    for (const Slot& slot : old) {
      if (slot.first != kNone) table_[SlotOf(slot.cell)] = slot;
    }
  }

  std::vector<Eigen::Vector3f>& positions_;
  float tolerance_m_;
  // Random for every part, so that no file can be crafted whose cells share slots. The numbers of
  // the vertices do not depend on it.
  const uint64_t seed_ = (uint64_t{std::random_device{}()} << 32) | std::random_device{}();
  std::vector<Slot> table_;
  size_t used_ = 0;
  std::vector<uint32_t> next_;
};

}  // namespace sightline
