// SPDX-License-Identifier: Apache-2.0
// Infers, from the numbers of images alone, how the images were made.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "core/image/image.h"

namespace sightline {

// Counts of all values.
using Histogram = std::vector<int64_t>;  // 65536 entries
Histogram CountValues(const Image<uint16_t>& image);

// Largest power of two that divides every value, 1 to 32768; 1 if all are 0.
int CommonPowerOfTwo(const Histogram& counts);

// The value at which the camera clips: the largest value, if its count is too large for a
// distribution that falls towards its end. One-sided binomial test of its count against those of
// the eight values below, at a level of 0.1 %; nullopt if the test does not reject.
std::optional<int> ClipLevel(const Histogram& counts);

// Largest number that the camera writes: the clip level if it is below `largest`, otherwise
// `largest`.
int UpperLimit(const Histogram& counts, int largest);

// Share of values that do not occur among those that should: where the 17 values about them occur
// at least 8 times each on average. Of data digitised once: nearly 0 (below 0.2 even with a strong
// integral nonlinearity); of 8-bit data stretched to 10 bits: 0.75. `clipped`: a value that is a
// limit (UpperLimit), not counted.
double MissingValueShare(const Histogram& counts, int clipped);

// True if all values are those of a narrower number with its upper bits repeated below:
// `narrow_bit` bits brought to `bit_depth_bit` by (v << s) | (v >> t).
bool IsBitReplicated(const Histogram& counts, int narrow_bit, int bit_depth_bit);

// Differences between neighbouring columns, relative to those of their row, averaged by place in
// blocks of eight columns. JPEG leaves steps at the edges of its blocks of 8 x 8.
struct BlockEdges {
  int phase = 0;     // column of the block after which the differences are largest
  double ratio = 1;  // of them to all others
  double score = 0;  // standard errors by which they are larger, by the scatter between columns
};
// All images have the same width (others are left out) and start at the same place of a block.
BlockEdges FindBlockEdges(const std::vector<const Image<uint16_t>*>& images);

}  // namespace sightline
