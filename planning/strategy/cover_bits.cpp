// SPDX-License-Identifier: Apache-2.0
#include "planning/strategy/cover_bits.h"

#include <bit>
#include <cassert>

#include "core/cpu/function_clones.h"

namespace sightline {

namespace {

SIGHTLINE_CLONES("popcnt") int64_t CountAnd(const uint64_t* a, const uint64_t* b, size_t words) {
  int64_t count = 0;
  for (size_t i = 0; i < words; ++i) count += std::popcount(a[i] & b[i]);
  return count;
}

SIGHTLINE_CLONES("popcnt") int64_t CountAndNot(const uint64_t* a, const uint64_t* b, size_t words) {
  int64_t count = 0;
  for (size_t i = 0; i < words; ++i) count += std::popcount(a[i] & ~b[i]);
  return count;
}

}  // namespace

int64_t CountInBoth(const TargetBits& a, const TargetBits& b) {
  assert(a.size() == b.size());
  return CountAnd(a.words().data(), b.words().data(), a.words().size());
}

int64_t CountOnlyIn(const TargetBits& a, const TargetBits& b) {
  assert(a.size() == b.size());
  return CountAndNot(a.words().data(), b.words().data(), a.words().size());
}

}  // namespace sightline
