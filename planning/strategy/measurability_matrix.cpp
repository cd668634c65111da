// SPDX-License-Identifier: Apache-2.0
#include "planning/strategy/measurability_matrix.h"

#include <bit>
#include <cassert>

namespace sightline {

void MeasurabilityMatrix::AddRow(const Measurement& measurement, const TargetBits& covered) {
  assert(covered.size() == targets_);
  const uint64_t begin = bytes_.size();
  const size_t dense_bytes = (targets_ + 7) / 8;
  size_t previous = 0;
  bool dense = false;
  for (size_t w = 0; w < covered.words().size() && !dense; ++w) {
    for (uint64_t word = covered.words()[w]; word != 0; word &= word - 1) {
      const size_t target = 64 * w + static_cast<size_t>(std::countr_zero(word));
      // The first difference is taken from -1, so that no difference is 0.
      size_t difference = target + 1 - previous;
      previous = target + 1;
      for (; difference >= 0x80; difference >>= 7) {
        bytes_.push_back(static_cast<uint8_t>(difference | 0x80));
      }
      bytes_.push_back(static_cast<uint8_t>(difference));
    }
    dense = bytes_.size() - begin > dense_bytes;
  }
  if (bytes_.size() == begin) return;
  if (dense) {
    bytes_.resize(begin);
    for (size_t i = 0; i < dense_bytes; ++i) {
      bytes_.push_back(static_cast<uint8_t>(covered.words()[i / 8] >> (8 * (i % 8))));
    }
  }
  measurements_.push_back(measurement);
  begin_.push_back(begin);
  dense_.push_back(dense);
}

template <typename Visit>
void MeasurabilityMatrix::ForEachByteCoded(size_t row, Visit visit) const {
  const size_t end = row + 1 < rows() ? begin_[row + 1] : bytes_.size();
  size_t position = 0;
  for (size_t i = begin_[row]; i < end;) {
    size_t difference = 0;
    for (int shift = 0;; shift += 7) {
      const uint8_t byte = bytes_[i++];
      difference |= static_cast<size_t>(byte & 0x7f) << shift;
      if (byte < 0x80) break;
    }
    position += difference;
    visit(position - 1);
  }
}

TargetBits MeasurabilityMatrix::Row(size_t row) const {
  TargetBits bits(targets_);
  if (IsDense(row)) {
    for (size_t i = 0; i < (targets_ + 7) / 8; ++i) {
      bits.words()[i / 8] |= uint64_t{bytes_[begin_[row] + i]} << (8 * (i % 8));
    }
  } else {
    ForEachByteCoded(row, [&](size_t target) { bits.Set(target); });
  }
  return bits;
}

int64_t MeasurabilityMatrix::NewTargets(size_t row, const TargetBits& covered) const {
  if (IsDense(row)) return Row(row).CountNotIn(covered);
  int64_t count = 0;
  ForEachByteCoded(row, [&](size_t target) { count += covered.Test(target) ? 0 : 1; });
  return count;
}

size_t MeasurabilityMatrix::MemoryBytes() const {
  return bytes_.capacity() + measurements_.capacity() * sizeof(Measurement) +
         begin_.capacity() * sizeof(uint64_t) + dense_.capacity() / 8;
}

LazyGreedy::LazyGreedy(const MeasurabilityMatrix& matrix) : matrix_(matrix) {
  const TargetBits nothing(matrix.targets());
  for (size_t row = 0; row < matrix.rows(); ++row) {
    queue_.push({matrix.NewTargets(row, nothing), row});
  }
}

std::optional<LazyGreedy::Choice> LazyGreedy::Next(const TargetBits& covered) {
  while (!queue_.empty()) {
    const Bound top = queue_.top();
    queue_.pop();
    const int64_t gain = matrix_.NewTargets(top.row, covered);
    if (gain == 0) continue;
    const Bound now{gain, top.row};
    if (queue_.empty() || queue_.top() < now) return Choice{top.row, gain};
    queue_.push(now);
  }
  return std::nullopt;
}

}  // namespace sightline
