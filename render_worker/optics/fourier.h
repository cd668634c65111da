// SPDX-License-Identifier: Apache-2.0
// One-dimensional Fourier transforms in single precision. Only this module uses FFTW.
#pragma once

#include <complex>
#include <cstddef>
#include <memory>

struct fftwf_plan_s;

namespace sightline {

// Zero-filled memory, aligned for the transforms. Rows of FourierStride(length) values in one
// buffer have the same alignment, so a plan performs the same arithmetic on each.
template <typename T>
class FourierBuffer {
 public:
  explicit FourierBuffer(size_t size);
  T* data() { return data_.get(); }
  const T* data() const { return data_.get(); }
  T& operator[](size_t i) { return data_.get()[i]; }
  const T& operator[](size_t i) const { return data_.get()[i]; }
  size_t size() const { return size_; }
  void Clear();

 private:
  struct Free {
    void operator()(T* data) const;
  };
  std::unique_ptr<T, Free> data_;
  size_t size_;
};

// Least multiple of 16 that holds `length` values.
inline size_t FourierStride(int length) { return (static_cast<size_t>(length) + 15) / 16 * 16; }

// Least m * factor >= at_least with prime factors of m up to 7, for which transforms are
// fast.
int FastLength(int at_least, int factor);

// Complex transform of one length, not normalised: forward sums x_j exp(-2 pi i j k / n). Copies
// share the plan. Plans live as long as the process and are made one at a time by FFTW's heuristic,
// so results do not depend on time measurements or threads.
class FourierPlan {
 public:
  enum class Direction { kForward, kBackward };
  FourierPlan(Direction direction, int length);
  // In place; `data` from a FourierBuffer, at a multiple of FourierStride.
  void Run(std::complex<float>* data) const;

 private:
  std::shared_ptr<fftwf_plan_s> plan_;
};

// Real input, coefficients 0 .. length/2 of the forward transform.
class RealFourierPlan {
 public:
  explicit RealFourierPlan(int length);
  void Run(float* input, std::complex<float>* output) const;

 private:
  std::shared_ptr<fftwf_plan_s> plan_;
};

// Coefficients 0 .. length/2 to a real signal, not normalised. Destroys its input.
class RealBackwardFourierPlan {
 public:
  explicit RealBackwardFourierPlan(int length);
  void Run(std::complex<float>* input, float* output) const;

 private:
  std::shared_ptr<fftwf_plan_s> plan_;
};

}  // namespace sightline
