// SPDX-License-Identifier: Apache-2.0
#include "render_worker/optics/fourier.h"

#include <fftw3.h>

#include <cstring>
#include <map>
#include <mutex>
#include <new>
#include <utility>

namespace sightline {
namespace {

enum class Kind { kForward, kBackward, kRealForward, kRealBackward };

fftwf_complex* AsFftw(std::complex<float>* data) { return reinterpret_cast<fftwf_complex*>(data); }

// FFTW's planner is not thread-safe; running a plan on other arrays is.
std::mutex& PlannerMutex() {
  static std::mutex mutex;
  return mutex;
}

std::shared_ptr<fftwf_plan_s> CachedPlan(Kind kind, int length) {
  const std::lock_guard lock(PlannerMutex());
  static std::map<std::pair<Kind, int>, std::shared_ptr<fftwf_plan_s>> plans;
  std::shared_ptr<fftwf_plan_s>& plan = plans[{kind, length}];
  if (plan == nullptr) {
    FourierBuffer<std::complex<float>> complex_data(FourierStride(length));
    FourierBuffer<float> real_data(FourierStride(length));
    fftwf_plan made = nullptr;
    switch (kind) {
      case Kind::kForward:
      case Kind::kBackward:
        made =
            fftwf_plan_dft_1d(length, AsFftw(complex_data.data()), AsFftw(complex_data.data()),
                              kind == Kind::kForward ? FFTW_FORWARD : FFTW_BACKWARD, FFTW_ESTIMATE);
        break;
      case Kind::kRealForward:
        made = fftwf_plan_dft_r2c_1d(length, real_data.data(), AsFftw(complex_data.data()),
                                     FFTW_ESTIMATE);
        break;
      case Kind::kRealBackward:
        made = fftwf_plan_dft_c2r_1d(length, AsFftw(complex_data.data()), real_data.data(),
                                     FFTW_ESTIMATE);
        break;
    }
    plan = std::shared_ptr<fftwf_plan_s>(made, fftwf_destroy_plan);
  }
  return plan;
}

}  // namespace

template <typename T>
FourierBuffer<T>::FourierBuffer(size_t size)
    : data_(static_cast<T*>(fftwf_malloc(sizeof(T) * size))), size_(size) {
  if (data_ == nullptr) throw std::bad_alloc();
  Clear();
}

template <typename T>
void FourierBuffer<T>::Clear() {
  std::memset(static_cast<void*>(data_.get()), 0, sizeof(T) * size_);
}

template <typename T>
void FourierBuffer<T>::Free::operator()(T* data) const {
  fftwf_free(data);
}

template class FourierBuffer<float>;
template class FourierBuffer<std::complex<float>>;

int FastLength(int at_least, int factor) {
  for (int m = (at_least + factor - 1) / factor;; ++m) {
    int rest = m;
    for (const int prime : {2, 3, 5, 7}) {
      while (rest % prime == 0) rest /= prime;
    }
    if (rest == 1) return m * factor;
  }
}

FourierPlan::FourierPlan(Direction direction, int length)
    : plan_(CachedPlan(direction == Direction::kForward ? Kind::kForward : Kind::kBackward,
                       length)) {}

void FourierPlan::Run(std::complex<float>* data) const {
  fftwf_execute_dft(plan_.get(), AsFftw(data), AsFftw(data));
}

RealFourierPlan::RealFourierPlan(int length) : plan_(CachedPlan(Kind::kRealForward, length)) {}

void RealFourierPlan::Run(float* input, std::complex<float>* output) const {
  fftwf_execute_dft_r2c(plan_.get(), input, AsFftw(output));
}

RealBackwardFourierPlan::RealBackwardFourierPlan(int length)
    : plan_(CachedPlan(Kind::kRealBackward, length)) {}

void RealBackwardFourierPlan::Run(std::complex<float>* input, float* output) const {
  fftwf_execute_dft_c2r(plan_.get(), AsFftw(input), output);
}

}  // namespace sightline
