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

// Fit of a plane over the image to the pixels around each pixel that lie on the same surface (same
// material, close to its tangent plane, similar normal), by least squares weighted with the samples
// of the pixels; the plane's value at the pixel replaces it. Weights depend on geometry only, so
// halves stay independent and light that varies linearly over the window is kept exactly. The
// window is bounded by the distance of what lights the surface, on whose scale irradiance varies
// (Ward and Heckbert 1992). Pixels that see more than one surface are left as they are,
// and so are surfaces with a height field, whose texture would be smoothed with the noise. Writes
// `rows` [first, end) of `filtered`.
void FilterRows(const PixelValues& noisy, const std::vector<PixelFeatures>& features,
                const std::vector<int>& samples, int radius_px, int first_row, int end_row,
                PixelValues& filtered);

}  // namespace sightline
