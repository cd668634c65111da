// SPDX-License-Identifier: Apache-2.0
#include "planning/strategy/top_points.h"

#include <algorithm>
#include <cmath>

namespace sightline {

void TopPoints::Add(const std::vector<double>& x, double value) {
  if (capacity_ == 0 || (entries_.size() >= capacity_ && value <= entries_.back().value)) return;
  const auto close = [&](const Entry& entry) {
    for (size_t i = 0; i < x.size(); ++i) {
      if (std::abs(entry.x[i] - x[i]) > separation_) return false;
    }
    return true;
  };
  for (const Entry& entry : entries_) {
    if (entry.value < value) break;
    if (close(entry)) return;
  }
  std::erase_if(entries_, close);
  const auto place = std::upper_bound(entries_.begin(), entries_.end(), value,
                                      [](double v, const Entry& e) { return v > e.value; });
  entries_.insert(place, {x, value});
  if (entries_.size() > capacity_) entries_.pop_back();
}

}  // namespace sightline
