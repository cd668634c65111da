// SPDX-License-Identifier: Apache-2.0
// Texts that hash tables of the standard library take for the same.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

namespace sightline {

// Texts of 16 bytes that std::hash of libstdc++ (MurmurHash64A of a seed that does not change)
// takes for the same: the second half follows from the first by running the hash backwards.
inline std::vector<std::string> SameHash(size_t count) {
  constexpr uint64_t kM = 0xc6a4a7935bd1e995u;
  uint64_t inverse = kM;
  for (int i = 0; i < 6; ++i) inverse *= 2 - kM * inverse;
  const auto mix = [](uint64_t v) { return v ^ (v >> 47); };
  const auto plain = [](unsigned char c) { return c > ' ' && c < 0x7f && c != '"' && c != '\\'; };
  std::vector<std::string> texts;
  for (uint64_t i = 0; texts.size() < count; ++i) {
    std::array<char, 16> text;
    for (int k = 0; k < 8; ++k) text[k] = static_cast<char>('0' + ((i >> (6 * k)) & 63));
    uint64_t first = 0;
    std::memcpy(&first, text.data(), 8);
    const uint64_t state = ((0xc70f6907u ^ (16 * kM)) ^ (mix(first * kM) * kM)) * kM;
    const uint64_t second = mix((0x123456789abcdef0u ^ state) * inverse) * inverse;
    std::memcpy(text.data() + 8, &second, 8);
    // From the end: the second half is nearly never text.
    if (std::all_of(text.rbegin(), text.rend(), plain)) texts.emplace_back(text.data(), 16);
  }
  return texts;
}

}  // namespace sightline
