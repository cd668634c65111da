// SPDX-License-Identifier: Apache-2.0
// Seeds of independent streams of random numbers.
#pragma once

#include <concepts>
#include <cstdint>

namespace sightline {

// One step of SplitMix64 (Steele, Lea, Flood 2014): turns any 64-bit number into a well mixed one.
constexpr uint64_t SplitMix64(uint64_t x) {
  x += 0x9e3779b97f4a7c15;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9;
  x = (x ^ (x >> 27)) * 0x94d049bb133111eb;
  return x ^ (x >> 31);
}

// A seed of its own for one purpose, e.g. DeriveSeed(seed, "speckle", 3).
uint64_t DeriveSeed(uint64_t seed, const char* purpose, uint64_t index = 0);

// The same for streams with numbers instead of names. It is a template, so that a literal 0 is a
// number, not a null pointer.
template <std::integral Stream>
constexpr uint64_t DeriveSeed(uint64_t seed, Stream stream) {
  return SplitMix64(SplitMix64(seed) ^ (static_cast<uint64_t>(stream) * 0xd1342543de82ef95 + 1));
}

}  // namespace sightline
