// SPDX-License-Identifier: Apache-2.0
// Medians and quantiles of samples, as values of the sample itself.
#pragma once

#include <algorithm>
#include <cassert>
#include <cstddef>
#include <utility>
#include <vector>

namespace sightline {

// The value at `rank` (0: the least) in ascending order; rank < values.size().
template <typename Value>
Value OrderStatistic(std::vector<Value> values, size_t rank) {
  assert(rank < values.size());
  const auto place = values.begin() + static_cast<std::ptrdiff_t>(rank);
  std::nth_element(values.begin(), place, values.end());
  return *place;
}

// The middle value; the upper one of the two middle ones if their number is even. There is one.
template <typename Value>
Value UpperMedian(std::vector<Value> values) {
  const size_t rank = values.size() / 2;
  return OrderStatistic(std::move(values), rank);
}

// The value at rank floor(fraction (n - 1)) of n > 0 values; fraction in [0, 1].
template <typename Value>
Value LowerQuantile(std::vector<Value> values, double fraction) {
  const auto rank = static_cast<size_t>(fraction * static_cast<double>(values.size() - 1));
  return OrderStatistic(std::move(values), rank);
}

// Quantile of the distribution whose values were rounded to whole numbers, linear within each of
// these. `ascending`: n > 0 sorted whole numbers; fraction in [0, 1). Differences of order
// statistics of rounded values are whole numbers themselves and may be off by half of a spread of
// one or two.
template <typename Value>
double QuantileBeforeRounding(const std::vector<Value>& ascending, double fraction) {
  assert(!ascending.empty() && fraction >= 0 && fraction < 1);
  const double rank = fraction * static_cast<double>(ascending.size());
  const Value value = ascending[static_cast<size_t>(rank)];
  const auto [first, last] = std::equal_range(ascending.begin(), ascending.end(), value);
  const auto before = static_cast<double>(first - ascending.begin());
  return static_cast<double>(value) - 0.5 + (rank - before) / static_cast<double>(last - first);
}

}  // namespace sightline
