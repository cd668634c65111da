// SPDX-License-Identifier: Apache-2.0
// Patterns that are fixed on the sensor.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "core/random/counter_random.h"
#include "render_worker/frame/ideal_image.h"

namespace sightline {

// Multiplies all light of every pixel by factor(column_px, row_px), in positions relative to the
// principal point.
template <typename Factor>
void MultiplyLight(PixelIrradiance& light, bool laser_only, const Factor& factor) {
  for (int i = 0; i < light.roi.rows_px; ++i) {
    for (int j = 0; j < light.roi.columns_px; ++j) {
      const float value = static_cast<float>(factor(light.roi.column_px + j, light.roi.row_px + i));
      if (!light.laser_irradiance_w_m2.empty()) light.laser_irradiance_w_m2.At(i, j) *= value;
      if (laser_only) continue;
      for (Image<float>& flux : light.incoherent_electron_flux_m2_s) {
        if (!flux.empty()) flux.At(i, j) *= value;
      }
    }
  }
}

// Random-number stream of a position on the sensor.
inline uint64_t PixelStream(int column_px, int row_px) {
  return static_cast<uint64_t>(static_cast<uint32_t>(row_px)) << 32 |
         static_cast<uint32_t>(column_px);
}

// Adds exponentially distributed charge of this mean to a fixed subset of the pixels: those whose
// own random number is below the given fraction. `roi`: position of the image on the sensor.
inline void AddToSomePixels(Image<double>& electrons, const RegionOfInterest& roi, uint64_t seed,
                            double part, double mean_electrons) {
  for (int i = 0; i < electrons.rows_px; ++i) {
    for (int j = 0; j < electrons.columns_px; ++j) {
      CounterRandom random(seed, PixelStream(roi.column_px + j, roi.row_px + i));
      if (random.Uniform() >= part) continue;
      electrons.At(i, j) -= mean_electrons * std::log(1 - random.Uniform());
    }
  }
}

}  // namespace sightline
