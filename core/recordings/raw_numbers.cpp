// SPDX-License-Identifier: Apache-2.0
#include "core/recordings/raw_numbers.h"

#include <algorithm>
#include <array>
#include <bit>
#include <boost/math/distributions/binomial.hpp>
#include <cmath>
#include <cstdlib>

namespace sightline {

Histogram CountValues(const Image<uint16_t>& image) {
  Histogram counts(65536);
  for (const uint16_t value : image.values) ++counts[value];
  return counts;
}

int CommonPowerOfTwo(const Histogram& counts) {
  unsigned bits = 0;
  for (size_t value = 0; value < counts.size(); ++value) {
    if (counts[value] > 0) bits |= static_cast<unsigned>(value);
  }
  return bits == 0 ? 1 : 1 << std::countr_zero(bits);
}

std::optional<int> ClipLevel(const Histogram& counts) {
  constexpr int kCompared = 8;
  constexpr double kLevel = 1e-3;
  const auto last = std::find_if(counts.rbegin(), counts.rend(), [](int64_t n) { return n > 0; });
  if (last == counts.rend()) return std::nullopt;
  const int top = static_cast<int>(counts.rend() - last) - 1;
  // If low bits are stuck, only multiples of the step can occur.
  const int step = CommonPowerOfTwo(counts);
  int compared = 0;
  int64_t below = 0;
  for (int value = top - step; value >= 0 && compared < kCompared; value -= step, ++compared) {
    below += counts[value];
  }
  if (compared == 0) return std::nullopt;
  // If the distribution falls, the last of compared + 1 values has at most this share of pixels.
  const double share = 1.0 / (compared + 1);
  const boost::math::binomial_distribution<double> falling(static_cast<double>(*last + below),
                                                           share);
  const double at_least =
      boost::math::cdf(boost::math::complement(falling, static_cast<double>(*last - 1)));
  return at_least < kLevel ? std::optional(top) : std::nullopt;
}

int UpperLimit(const Histogram& counts, int largest) {
  return std::min(largest, ClipLevel(counts).value_or(largest));
}

double MissingValueShare(const Histogram& counts, int clipped) {
  constexpr int kHalf = 8;
  constexpr double kEach = 8;
  // The clipped value's count says nothing about its neighbours.
  Histogram kept = counts;
  if (clipped >= 0 && clipped < static_cast<int>(kept.size())) kept[clipped] = 0;
  const int size = static_cast<int>(kept.size());
  const int last = clipped > 0 ? clipped : size;
  int expected = 0, missing = 0;
  int64_t sum = 0;
  for (int value = 0; value < std::min(kHalf, size); ++value) sum += kept[value];
  for (int value = 0; value < last; ++value) {
    if (value + kHalf < size) sum += kept[value + kHalf];
    if (value - kHalf - 1 >= 0) sum -= kept[value - kHalf - 1];
    // Below the dark level and next to the limit values end for other reasons.
    if (value < kHalf || value + kHalf >= last) continue;
    if (static_cast<double>(sum) < kEach * (2 * kHalf + 1)) continue;
    // One value that many pixels share is no comb.
    if (2 * kept[value] > sum) continue;
    const bool below = std::any_of(kept.begin() + value - kHalf, kept.begin() + value,
                                   [](int64_t count) { return count > 0; });
    const bool above = std::any_of(kept.begin() + value + 1, kept.begin() + value + kHalf + 1,
                                   [](int64_t count) { return count > 0; });
    if (!below || !above) continue;
    ++expected;
    if (kept[value] == 0) ++missing;
  }
  return expected < 24 ? 0 : static_cast<double>(missing) / expected;
}

bool IsBitReplicated(const Histogram& counts, int narrow_bit, int bit_depth_bit) {
  const int up = bit_depth_bit - narrow_bit;
  if (up <= 0 || up > narrow_bit) return false;
  int different = 0;
  for (size_t value = 0; value < counts.size(); ++value) {
    if (counts[value] == 0) continue;
    const size_t narrow = value >> up;
    if (value != ((narrow << up) | (narrow >> (narrow_bit - up)))) return false;
    if (narrow >> (narrow_bit - up) != 0) ++different;
  }
  // Small numbers alone look the same as stuck low bits.
  return different >= 8;
}

BlockEdges FindBlockEdges(const std::vector<const Image<uint16_t>*>& images) {
  BlockEdges edges;
  if (images.empty()) return edges;
  const int columns = images.front()->columns_px;
  if (columns < 64) return edges;
  std::vector<double> steps(static_cast<size_t>(columns) - 1);  // after column j
  for (const Image<uint16_t>* image : images) {
    if (image->columns_px != columns) continue;
    for (int row = 0; row < image->rows_px; ++row) {
      const uint16_t* values = image->Row(row);
      double mean = 0;
      for (int j = 0; j + 1 < columns; ++j) mean += std::abs(values[j + 1] - values[j]);
      mean /= columns - 1;
      // Rows that hardly vary have nothing to compare.
      if (mean < 0.1) continue;
      for (int j = 0; j + 1 < columns; ++j) {
        // Hot pixels and the like count no more than other large steps.
        steps[j] += std::min(6.0, std::abs(values[j + 1] - values[j]) / mean);
      }
    }
  }
  std::array<double, 8> sum{}, squares{}, mean{};
  std::array<int, 8> count{};
  for (int j = 0; j + 1 < columns; ++j) {
    sum[j % 8] += steps[j];
    squares[j % 8] += steps[j] * steps[j];
    ++count[j % 8];
  }
  double total = 0;
  for (int k = 0; k < 8; ++k) {
    mean[k] = sum[k] / count[k];
    total += mean[k] / 8;
  }
  if (!(total > 0)) return edges;
  edges.phase = static_cast<int>(std::max_element(mean.begin(), mean.end()) - mean.begin());
  const double others = (8 * total - mean[edges.phase]) / 7;
  double variance = 0, next = 0;
  for (int k = 0; k < 8; ++k) {
    variance += (squares[k] / count[k] - mean[k] * mean[k]) / 8;
    if (k != edges.phase) next = std::max(next, mean[k]);
  }
  edges.ratio = others > 0 ? mean[edges.phase] / others : 1e9;
  const double error = std::sqrt(std::max(variance, 1e-12) / count[edges.phase]);
  edges.score = (mean[edges.phase] - others) / error;
  // A sensor with eight readout taps differs from tap to tap, not at one edge only.
  if (next - others > 0.5 * (mean[edges.phase] - others)) edges.score = 0;
  return edges;
}

}  // namespace sightline
