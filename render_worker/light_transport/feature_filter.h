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

// Fits of a plane and of a paraboloid over the image to the pixels around each pixel that lie on
// the same surface (same material, close to its tangent plane, similar normal), by least squares
// weighted with the samples of the pixels; the fit's value at the pixel replaces it. Weights depend
// on geometry only, so halves stay independent, and light that varies linearly (quadratically) over
// the window is kept exactly. The paraboloid follows the light more closely and lets more noise
// through; where the two differ by more than their noise, the plane is biased. The window is
// bounded by the distance of what lights the surface, on whose scale irradiance varies (Ward and
// Heckbert 1992). Pixels that see more than one surface are left as they are, and so are surfaces
// with a height field, whose texture would be smoothed with the noise.
class FeatureFilter {
 public:
  // radius_px: of the largest window; stride at most 16.
  FeatureFilter(const PixelValues& noisy, const std::vector<PixelFeatures>& features,
                const std::vector<int>& samples, int radius_px);

  // Rows [first, end) of both.
  void Rows(int first_row, int end_row, PixelValues& plane, PixelValues& paraboloid) const;

  // One plane per feature and value, with a margin left and right: whole vectors can be read
  // everywhere.
  struct Layout {
    int columns = 0, rows = 0, stride = 0, margin = 0, width = 0;
    std::vector<float> material;  // 0: not to be used
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
