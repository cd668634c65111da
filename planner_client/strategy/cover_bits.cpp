#include "planner_client/strategy/cover_bits.h"

#include <bit>
#include <cassert>

#if defined(__x86_64__) && defined(__GNUC__) && !defined(SIGHTLINE_NO_TARGET_CLONES)
#define SIGHTLINE_POPCNT_CLONES __attribute__((target_clones("popcnt", "default")))
#else
#define SIGHTLINE_POPCNT_CLONES
#endif

namespace sightline {

namespace {

SIGHTLINE_POPCNT_CLONES int64_t CountAnd(const uint64_t* a, const uint64_t* b, size_t words) {
  int64_t count = 0;
  for (size_t i = 0; i < words; ++i) count += std::popcount(a[i] & b[i]);
  return count;
}

SIGHTLINE_POPCNT_CLONES int64_t CountAndNot(const uint64_t* a, const uint64_t* b, size_t words) {
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
