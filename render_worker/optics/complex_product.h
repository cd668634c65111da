#pragma once

#include <complex>

namespace sightline {

// a b without the checks for infinities that the standard operator makes.
inline std::complex<float> Product(std::complex<float> a, std::complex<float> b) {
  return {a.real() * b.real() - a.imag() * b.imag(), a.real() * b.imag() + a.imag() * b.real()};
}

inline float SquaredModulus(std::complex<float> a) {
  return a.real() * a.real() + a.imag() * a.imag();
}

}  // namespace sightline
