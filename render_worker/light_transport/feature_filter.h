// SPDX-License-Identifier: Apache-2.0
// Smooths noise of slowly varying light within one surface.
#pragma once

#include <vector>

#include "core/image/image.h"
#include "render_worker/light_transport/adaptive_image.h"

namespace sightline {

// Values of the pixels, `stride` floats each (both halves of all channels).
struct PixelValues {
  int columns_px = 0;
  int rows_px = 0;
  int stride = 0;
  std::vector<float> values;

  float* At(size_t pixel) { return values.data() + pixel * stride; }
  const float* At(size_t pixel) const { return values.data() + pixel * stride; }
};

// Around each pixel, a plane and a paraboloid over the image are fitted to the pixels on the same
// surface (same material, close to its tangent plane, similar normal), by least squares weighted
// with the pixels' samples. The fit's value at the pixel replaces it. Weights depend on geometry
// only, so halves stay independent, and light that varies linearly (quadratically) over the window
// is reproduced exactly. The paraboloid follows the light more closely but passes more noise; if
// the two differ by more than their noise, the plane is biased. The window is limited by the
// distance of the light's origin, the scale on which irradiance varies (Ward and Heckbert 1992).
// Pixels with more than one surface stay unchanged, and so do surfaces with a height field, whose
// texture would be smoothed with the noise.
class FeatureFilter {
 public:
  // radius_px: of the largest window; stride at most 16.
  FeatureFilter(const PixelValues& noisy, const std::vector<PixelFeatures>& features,
                const std::vector<int>& samples, int radius_px);

  // Rows [first, end) of both.
  void Rows(int first_row, int end_row, PixelValues& plane, PixelValues& paraboloid) const;

  // One plane per feature and value, with a margin left and right so that whole vectors can be read
  // everywhere.
  struct Layout {
    int columns = 0, rows = 0, stride = 0, margin = 0, width = 0;
    std::vector<float> material;  // 0: pixel is not used
    std::vector<float> position_m[3], normal[3], samples;
    std::vector<std::vector<float>> values;
  };

 private:
  const PixelValues& noisy_;
  const std::vector<PixelFeatures>& features_;
  int radius_px_;
  Layout layout_;
};

}  // namespace sightline
