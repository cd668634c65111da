// SPDX-License-Identifier: Apache-2.0
// Random numbers as a pure function of a seed and a place, so that images do not depend on the
// order in which threads draw them. Philox 4x32-10 (Salmon et al., SC 2011) from Random123.
#pragma once

#include <Random123/philox.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>

#include "core/random/seed.h"

namespace sightline {

// A stream of its own for every (seed, stream, index); draws follow each other within it.
class CounterRandom {
 public:
  CounterRandom(uint64_t seed, uint64_t stream, uint32_t index = 0)
      : counter_{{static_cast<uint32_t>(stream), static_cast<uint32_t>(stream >> 32), index, 0}},
        key_{{static_cast<uint32_t>(seed), static_cast<uint32_t>(seed >> 32)}} {}

  uint32_t Bits() {
    if (left_ == 0) {
      block_ = r123::Philox4x32()(counter_, key_);
      ++counter_[3];
      left_ = 4;
    }
    return block_[4 - left_--];
  }
  // In [0, 1), 32 bits.
  double Uniform() { return Bits() * 0x1p-32; }
  float UniformFloat() { return static_cast<float>(Bits() >> 8) * 0x1p-24F; }
  // Two independent standard normal numbers (Box and Muller 1958).
  std::array<double, 2> NormalPair() {
    const double radius = std::sqrt(-2 * std::log((Bits() + 1.0) * 0x1p-32));
    const double angle = 2 * std::numbers::pi * Uniform();
    return {radius * std::cos(angle), radius * std::sin(angle)};
  }
  double Normal() { return NormalPair()[0]; }

 private:
  r123::Philox4x32::ctr_type counter_;
  r123::Philox4x32::key_type key_;
  r123::Philox4x32::ctr_type block_ = {};
  int left_ = 0;
};

}  // namespace sightline
