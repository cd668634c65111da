// SPDX-License-Identifier: Apache-2.0
// Exact means over pixels of a band-limited signal given at sub-pixels.
#pragma once

#include <complex>
#include <vector>

#include "render_worker/optics/fourier.h"

namespace sightline {

// Mean over every pixel of a periodic signal of `pixels` pixels with `sub_pixels` samples each and
// a band below the samples' Nyquist frequency: its spectrum times sinc(q p), at the pixels'
// centres. Sample 0 is the first of pixel 0, so centres are (sub_pixels - 1)/2 samples after it.
class PixelIntegration {
 public:
  PixelIntegration(int pixels, int sub_pixels);

  int samples() const { return samples_; }
  int pixels() const { return pixels_; }
  // Work arrays of one thread.
  struct Work {
    explicit Work(const PixelIntegration& integration);
    FourierBuffer<float> samples;
    FourierBuffer<std::complex<float>> sample_spectrum;
    FourierBuffer<std::complex<float>> pixel_spectrum;
    FourierBuffer<float> pixels;
  };
  // work.samples -> work.pixels.
  void Run(Work& work) const;

  // sinc(q p) times the phase of the pixel centre, at frequency k of the period, |k| < samples/2.
  std::complex<float> Kernel(int k) const;

 private:
  int pixels_, samples_, sub_pixels_;
  std::vector<std::complex<float>> kernel_;  // k = 0 .. (samples - 1)/2
  RealFourierPlan forward_;
  RealBackwardFourierPlan backward_;
};

}  // namespace sightline
