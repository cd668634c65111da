// SPDX-License-Identifier: Apache-2.0
// Random numbers from the operating system.
#pragma once

#include <cstdint>
#include <random>

namespace sightline {

// 64 random bits of the operating system.
inline uint64_t RandomBits() {
  std::random_device device;
  const uint64_t high = device();
  return high << 32 | device();
}

}  // namespace sightline
