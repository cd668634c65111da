#include "render_worker/light_transport/feature_filter.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace sightline {
namespace {

constexpr float kNormalScale = 0.06F;      // of the difference of unit normals: facets stay apart
constexpr float kPlaneScale_px = 3;        // of the distance from the tangent plane
constexpr float kDistanceFraction = 0.5F;  // of the window in the distance of what lights it
constexpr int kMaxStride = 16;

}  // namespace

void FilterRows(const PixelValues& noisy, const std::vector<PixelFeatures>& features,
                const std::vector<int>& samples, int radius_px, int first_row, int end_row,
                PixelValues& filtered) {
  const int columns = noisy.columns_px, rows = noisy.rows_px, stride = noisy.stride;
  for (int i = first_row; i < end_row; ++i) {
    for (int j = 0; j < columns; ++j) {
      const size_t pixel = static_cast<size_t>(i) * columns + j;
      const PixelFeatures& centre = features[pixel];
      const float* own = noisy.At(pixel);
      float* out = filtered.At(pixel);
      std::copy(own, own + stride, out);
      if (!centre.uniform || centre.textured || centre.material == 0xffff ||
          centre.footprint_m <= 0)
        continue;
      float reach = static_cast<float>(radius_px);
      if (centre.inverse_distance_1_m > 0) {
        reach =
            std::min(reach, kDistanceFraction / (centre.inverse_distance_1_m * centre.footprint_m));
      }
      const int radius = static_cast<int>(reach);
      if (radius < 1) continue;

      const float inverse_normal = 1 / (kNormalScale * kNormalScale);
      const float inverse_plane = 1 / (kPlaneScale_px * centre.footprint_m);
      const float inverse_reach = 1 / ((reach + 1) * (reach + 1));
      double s = 0, sx = 0, sy = 0, sxx = 0, sxy = 0, syy = 0;
      std::array<float, kMaxStride> y0 = {}, yx = {}, yy = {};
      for (int di = std::max(-radius, -i); di <= std::min(radius, rows - 1 - i); ++di) {
        for (int dj = std::max(-radius, -j); dj <= std::min(radius, columns - 1 - j); ++dj) {
          const size_t other = pixel + static_cast<ptrdiff_t>(di) * columns + dj;
          const PixelFeatures& f = features[other];
          if (!f.uniform || f.textured || f.material != centre.material) continue;
          const float spatial = 1 - static_cast<float>(di * di + dj * dj) * inverse_reach;
          if (spatial <= 0) continue;
          const float normal = 1 - (f.normal - centre.normal).squaredNorm() * inverse_normal;
          if (normal <= 0) continue;
          const float distance =
              centre.normal.dot(f.position_m - centre.position_m) * inverse_plane;
          const float plane = 1 - distance * distance;
          if (plane <= 0) continue;
          const float w =
              spatial * normal * normal * plane * plane * static_cast<float>(samples[other]);
          const float wx = w * static_cast<float>(dj), wy = w * static_cast<float>(di);
          s += w;
          sx += wx;
          sy += wy;
          sxx += wx * static_cast<float>(dj);
          sxy += wx * static_cast<float>(di);
          syy += wy * static_cast<float>(di);
          const float* value = noisy.At(other);
          for (int c = 0; c < stride; ++c) {
            y0[c] += w * value[c];
            yx[c] += wx * value[c];
            yy[c] += wy * value[c];
          }
        }
      }
      // Value at the centre of the fitted plane: first row of the inverse of the moment matrix. A
      // ridge on the slopes keeps windows of a few pixels in a row solvable.
      const double ridge = 1e-3 * s;
      sxx += ridge;
      syy += ridge;
      const double a = sxx * syy - sxy * sxy, b = sxy * sy - sx * syy, c = sx * sxy - sxx * sy;
      const double determinant = s * a + sx * b + sy * c;
      if (!(determinant > 1e-9 * s * sxx * syy)) continue;
      for (int k = 0; k < stride; ++k) {
        out[k] = static_cast<float>((a * y0[k] + b * yx[k] + c * yy[k]) / determinant);
      }
    }
  }
}

}  // namespace sightline
