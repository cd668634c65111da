// SPDX-License-Identifier: Apache-2.0
// The measurability matrix: coverage of many random scans (thesis section 2.2.1; Scott 2009).
#pragma once

#include <cstdint>
#include <optional>
#include <queue>
#include <vector>

#include "core/rig/measurement.h"
#include "core/targets/target_set.h"

namespace sightline {

// Rows are scans, columns targets. A row takes about one byte per covered target (differences
// between target numbers in 7-bit groups), or one bit per target where that is less, so that
// 1.5 million random scans of 20 000 targets fit into a few gigabytes at most.
class MeasurabilityMatrix {
 public:
  explicit MeasurabilityMatrix(size_t targets) : targets_(targets) {}

  // Scans that cover nothing are not kept. `covered` has one bit per target.
  void AddRow(const Measurement& measurement, const TargetBits& covered);

  size_t targets() const { return targets_; }
  size_t rows() const { return measurements_.size(); }
  const Measurement& measurement(size_t row) const { return measurements_[row]; }
  TargetBits Row(size_t row) const;
  // Number of covered targets of the row that are not in `covered`.
  int64_t NewTargets(size_t row, const TargetBits& covered) const;
  size_t MemoryBytes() const;

 private:
  template <typename Visit>
  void ForEachByteCoded(size_t row, Visit visit) const;
  bool IsDense(size_t row) const { return dense_[row]; }

  size_t targets_;
  std::vector<Measurement> measurements_;
  std::vector<uint64_t> begin_;  // of each row in bytes_
  std::vector<bool> dense_;
  std::vector<uint8_t> bytes_;
};

// Repeatedly chooses the row with the most new targets (the first if equal) by the lazy evaluation
// of Minoux 1978. A row's gain only shrinks as targets get covered, so only rows whose last known
// gain still leads are counted again.
class LazyGreedy {
 public:
  explicit LazyGreedy(const MeasurabilityMatrix& matrix);

  // Removes and returns the best row with its gain, given the covered targets. Empty when no row
  // gains anything. `covered` must never lose targets from call to call.
  struct Choice {
    size_t row;
    int64_t new_targets;
  };
  std::optional<Choice> Next(const TargetBits& covered);

 private:
  struct Bound {
    int64_t gain;
    size_t row;
    // Least important first: std::priority_queue gives the greatest gain, then the first row.
    bool operator<(const Bound& other) const {
      return gain != other.gain ? gain < other.gain : row > other.row;
    }
  };
  const MeasurabilityMatrix& matrix_;
  std::priority_queue<Bound> queue_;
};

}  // namespace sightline
