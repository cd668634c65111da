// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/selection/evident_effects.h"

#include <algorithm>
#include <bit>
#include <bitset>
#include <cstdint>

#include "render_worker/effects/vocabulary.h"

namespace sightline {
namespace {

// Least number of different values. Derived: if both values of the lowest bit are equally likely,
// it is 0 in this many values with a probability of 2^-16.
constexpr size_t kLeastNumbers = 16;

// Number of lowest bits that are 0 in all values; 0 also if there are too few different values.
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
