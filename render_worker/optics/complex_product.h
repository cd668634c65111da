// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <complex>

namespace sightline {

// a b without the standard operator's checks for infinities.
inline std::complex<float> Product(std::complex<float> a, std::complex<float> b) {
  return {a.real() * b.real() - a.imag() * b.imag(), a.real() * b.imag() + a.imag() * b.real()};
}

// exp(2 pi i turns) to 1e-6; |turns| < 1e9. Minimax polynomials of half the angle allow vectorised
// loops, unlike calls of the standard functions.
inline std::complex<float> PhasorOfTurns(double turns) {
  constexpr double kWhole = 6755399441055744.0;  // 1.5 * 2^52: adding it rounds to whole numbers
  const double whole = (turns + kWhole) - kWhole;
  const auto half = static_cast<float>(turns - whole);
  const float u = half * half;
  const float sine =
      half * (3.14159264F +
              u * (-5.16771008F + u * (2.55007752F + u * (-0.598291286F + u * 0.0776576603F))));
  const float cosine =
      1.0F + u * (-4.93480214F +
                  u * (4.05870916F + u * (-1.33521200F + u * (0.234937313F - u * 0.0243963236F))));
  return {1.0F - 2 * sine * sine, 2 * sine * cosine};
}

inline float SquaredModulus(std::complex<float> a) {
  return a.real() * a.real() + a.imag() * a.imag();
}

}  // namespace sightline
