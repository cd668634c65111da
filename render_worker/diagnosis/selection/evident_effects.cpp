// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/selection/evident_effects.h"

#include <algorithm>
#include <bit>
#include <bitset>
#include <cstdint>

#include "render_worker/effects/vocabulary.h"

namespace sightline {
namespace {

// Different numbers that must occur. Derived: if both values of the lowest bit were equally likely,
// it would be 0 in all of so many numbers with a probability of 2^-16.
constexpr size_t kLeastNumbers = 16;

// Lowest bits that are 0 in all numbers; 0: too few different numbers to tell.
int MissingBits(const RecordedSet& set) {
  std::bitset<1 << 16> occurs;
  uint32_t bits = 0;
  for (const RecordedFrame& frame : set.frames) {
    for (const uint16_t dn : frame.raw_dn.values) {
      occurs.set(dn);
      bits |= dn;
    }
  }
  return occurs.count() < kLeastNumbers ? 0 : std::countr_zero(bits);
}

}  // namespace

std::vector<ActiveEffect> EvidentEffects(const RecordedSet& set,
                                         std::span<const Effect* const> considered) {
  const Effect& effect = AdcMissingBits();
  if (std::find(considered.begin(), considered.end(), &effect) == considered.end()) return {};
  const double missing = MissingBits(set);
  const EffectParameter& parameter = effect.description().parameters.front();
  if (missing == 0 || missing > parameter.upper) return {};
  return {{&effect, {missing}}};
}

}  // namespace sightline
