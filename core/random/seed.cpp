// SPDX-License-Identifier: Apache-2.0
#include "core/random/seed.h"

#include "core/random/counter_random.h"

namespace sightline {

uint64_t DeriveSeed(uint64_t seed, const char* purpose, uint64_t index) {
  // FNV-1a of the purpose selects the stream.
  uint64_t hash = 0xcbf29ce484222325;
  for (const char* c = purpose; *c != '\0'; ++c) {
    hash = (hash ^ static_cast<unsigned char>(*c)) * 0x100000001b3;
  }
  CounterRandom random(seed ^ hash, index, 0x5eed);
  const uint64_t high = random.Bits();
  return high << 32 | random.Bits();
}

}  // namespace sightline
