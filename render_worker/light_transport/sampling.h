// SPDX-License-Identifier: Apache-2.0
// Low-discrepancy sample points: Owen-scrambled Sobol sequences, in groups of four dimensions.
#pragma once

#include <array>
#include <cstdint>

namespace sightline {

inline uint32_t ReverseBits(uint32_t x) {
  x = (x >> 16) | (x << 16);
  x = ((x & 0xff00ff00u) >> 8) | ((x & 0x00ff00ffu) << 8);
  x = ((x & 0xf0f0f0f0u) >> 4) | ((x & 0x0f0f0f0fu) << 4);
  x = ((x & 0xccccccccu) >> 2) | ((x & 0x33333333u) << 2);
  return ((x & 0xaaaaaaaau) >> 1) | ((x & 0x55555555u) << 1);
}

// Mixes two words (finaliser of MurmurHash3).
inline uint32_t HashWords(uint32_t a, uint32_t b) {
  uint32_t h = a * 0x9e3779b9u ^ (b + 0x7f4a7c15u + (a << 6) + (a >> 2));
  h = (h ^ (h >> 16)) * 0x85ebca6bu;
  h = (h ^ (h >> 13)) * 0xc2b2ae35u;
  return h ^ (h >> 16);
}

// Nested uniform (Owen) scrambling by hashing; Burley, "Practical hash-based Owen scrambling",
// JCGT 2020, with Vegdahl's constants.
inline uint32_t OwenScramble(uint32_t x, uint32_t seed) {
  x = ReverseBits(x);
  x ^= x * 0x3d20adeau;
  x += seed;
  x *= (seed >> 16) | 1u;
  x ^= x * 0x05526c56u;
  x ^= x * 0x53a22864u;
  return ReverseBits(x);
}

// Direction numbers of the first four Sobol dimensions (Joe and Kuo 2008).
constexpr std::array<std::array<uint32_t, 32>, 4> SobolDirections() {
  std::array<std::array<uint32_t, 32>, 4> v = {};
  constexpr uint32_t kDegree[4] = {0, 1, 2, 3};
  constexpr uint32_t kCoefficients[4] = {0, 0, 1, 1};
  constexpr uint32_t kInitial[4][3] = {{0, 0, 0}, {1, 0, 0}, {1, 3, 0}, {1, 3, 1}};
  for (uint32_t i = 0; i < 32; ++i) v[0][i] = 1u << (31 - i);
  for (uint32_t d = 1; d < 4; ++d) {
    const uint32_t s = kDegree[d];
    for (uint32_t i = 0; i < 32; ++i) {
      if (i < s) {
        v[d][i] = kInitial[d][i] << (31 - i);
        continue;
      }
      v[d][i] = v[d][i - s] ^ (v[d][i - s] >> s);
      for (uint32_t k = 1; k < s; ++k) {
        if (((kCoefficients[d] >> (s - 1 - k)) & 1u) != 0) v[d][i] ^= v[d][i - k];
      }
    }
  }
  return v;
}

// Samples of one pixel. Neighbouring pixels take consecutive segments of one sequence in Morton
// order (Ahmed and Wonka 2020), so that means over blocks of pixels converge as fast as the
// sequence.
class PixelSamples {
 public:
  // 2^log2_per_pixel samples; each seed gives an independent scrambling.
  PixelSamples(uint64_t seed, int column, int row, int log2_per_pixel)
      : seed_(HashWords(static_cast<uint32_t>(seed), static_cast<uint32_t>(seed >> 32))),
        bits_(16 + log2_per_pixel),
        first_(Morton(column & 255, row & 255) << log2_per_pixel) {
    seed_ = HashWords(seed_, static_cast<uint32_t>(column >> 8));
    seed_ = HashWords(seed_, static_cast<uint32_t>(row >> 8));
  }

  void Start(uint32_t sample) {
    index_ = first_ + sample;
    group_ = 0;
  }

  // The next four dimensions, each in [0, 1).
  std::array<float, 4> Next() {
    static constexpr auto kDirections = SobolDirections();
    const uint32_t seed = HashWords(seed_, ++group_);
    // Each group permutes the same blocks in another order, which makes the groups independent.
    uint32_t index = OwenScramble(index_ << (32 - bits_), seed) >> (32 - bits_);
    std::array<uint32_t, 4> x = {};
    for (int bit = 0; index != 0; ++bit, index >>= 1) {
      if ((index & 1u) == 0) continue;
      for (int d = 0; d < 4; ++d) x[d] ^= kDirections[d][bit];
    }
    std::array<float, 4> u;
    for (int d = 0; d < 4; ++d) {
      u[d] = static_cast<float>(OwenScramble(x[d], HashWords(seed, d + 1)) >> 8) * 0x1p-24F;
    }
    return u;
  }

 private:
  static uint32_t Morton(uint32_t x, uint32_t y) {
    const auto spread = [](uint32_t v) {
      v = (v | (v << 4)) & 0x0f0fu;
      v = (v | (v << 2)) & 0x3333u;
      return (v | (v << 1)) & 0x5555u;
    };
    return spread(x) | (spread(y) << 1);
  }

  uint32_t seed_;
  int bits_;
  uint32_t first_;
  uint32_t index_ = 0;
  uint32_t group_ = 0;
};

}  // namespace sightline
