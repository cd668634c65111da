// SPDX-License-Identifier: Apache-2.0
#include "render_worker/optics/pixel_integration.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <numbers>

#include "render_worker/optics/complex_product.h"

namespace sightline {

PixelIntegration::Work::Work(const PixelIntegration& integration)
    : samples(FourierStride(integration.samples_)),
      sample_spectrum(FourierStride(integration.samples_)),
      pixel_spectrum(FourierStride(integration.pixels_)),
      pixels(FourierStride(integration.pixels_)) {}

PixelIntegration::PixelIntegration(int pixels, int sub_pixels)
    : pixels_(pixels),
      samples_(pixels * sub_pixels),
      sub_pixels_(sub_pixels),
      forward_(samples_),
      backward_(pixels) {
  for (int k = 0; 2 * k < samples_; ++k) {
    // q p = k sub_pixels / samples = k / pixels.
    const double cycles = static_cast<double>(k) / pixels_;
    const double x = std::numbers::pi * cycles;
    const double sinc = k == 0 ? 1 : std::sin(x) / x;
    const double phase =
        2 * std::numbers::pi * k * (0.5 * (sub_pixels_ - 1)) / static_cast<double>(samples_);
    kernel_.push_back(
        {static_cast<float>(sinc * std::cos(phase)), static_cast<float>(sinc * std::sin(phase))});
  }
}

std::complex<float> PixelIntegration::Kernel(int k) const {
  const std::complex<float> value = kernel_[static_cast<size_t>(std::abs(k))];
  return k < 0 ? std::conj(value) : value;
}

void PixelIntegration::Run(Work& work) const {
  forward_.Run(work.samples.data(), work.sample_spectrum.data());
  // Evaluating at every sub_pixels-th place folds the spectrum.
  work.pixel_spectrum.Clear();
  const int half = pixels_ / 2;
  for (size_t k = 0; k < kernel_.size(); ++k) {
    const std::complex<float> value = Product(work.sample_spectrum[k], kernel_[k]);
    const int folded = static_cast<int>(k) % pixels_;
    if (folded <= half) work.pixel_spectrum[folded] += value;
    const int mirrored = (pixels_ - folded) % pixels_;
    if (k != 0 && mirrored <= half) work.pixel_spectrum[mirrored] += std::conj(value);
  }
  backward_.Run(work.pixel_spectrum.data(), work.pixels.data());
  const float scale = 1.0F / static_cast<float>(samples_);
  for (int j = 0; j < pixels_; ++j) work.pixels[j] *= scale;
}

}  // namespace sightline
