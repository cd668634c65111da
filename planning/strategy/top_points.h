// SPDX-License-Identifier: Apache-2.0
// The best few clearly different points of a search.
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

  // Keeps at most `capacity` points, no two closer than `separation` in every coordinate; of two
  // such points it keeps the better one (the earlier one if equal).
  TopPoints(size_t capacity, double separation) : capacity_(capacity), separation_(separation) {}

  void Add(const std::vector<double>& x, double value);

  // Entries, best first; equal values in the order of insertion.
  const std::vector<Entry>& entries() const { return entries_; }

 private:
  size_t capacity_;
  double separation_;
  std::vector<Entry> entries_;
};

}  // namespace sightline
