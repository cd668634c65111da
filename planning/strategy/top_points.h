// SPDX-License-Identifier: Apache-2.0
// The best few clearly different points a search has seen.
#pragma once

#include <cstddef>
#include <vector>

namespace sightline {

class TopPoints {
 public:
  struct Entry {
    std::vector<double> x;
    double value;
  };

  // Keeps at most `capacity` points, no two closer than `separation` in every coordinate: of such
  // a pair the better one stays (the earlier one if equal).
  TopPoints(size_t capacity, double separation) : capacity_(capacity), separation_(separation) {}

  void Add(const std::vector<double>& x, double value);

  // Best first; equal values in the order in which they came.
  const std::vector<Entry>& entries() const { return entries_; }

 private:
  size_t capacity_;
  double separation_;
  std::vector<Entry> entries_;
};

}  // namespace sightline
