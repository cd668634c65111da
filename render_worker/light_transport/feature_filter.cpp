// SPDX-License-Identifier: Apache-2.0
#include "render_worker/light_transport/feature_filter.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>

#include "core/cpu/function_clones.h"

namespace sightline {
namespace {

constexpr float kNormalScale = 0.06F;      // of the difference of unit normals: facets stay apart
constexpr float kPlaneScale_px = 3;        // of the distance from the tangent plane
constexpr float kDistanceFraction = 1.0F;  // of the window in the distance of what lights it
constexpr int kMaxStride = 16;
constexpr int kLanes = 8;
constexpr int kTerms = 6;  // 1, x, y, x^2, xy, y^2

// Lanes are summed in a fixed order, so every instruction set gives the same bytes.
using Lanes = float __attribute__((vector_size(4 * kLanes), aligned(4), may_alias));
using LaneMask = int __attribute__((vector_size(4 * kLanes)));

// Constants of one window.
struct Window {
  int row, column, radius;
  float inverse_reach;  // coordinates x, y are in units of the reach
  float material, position_m[3], normal[3];
  float inverse_normal2, inverse_plane2;
};

// Moments of the weights, sum of w x^a y^b with a + b <= 4.
using Moments = std::array<std::array<double, 5>, 5>;
// Value of the fit at x = y = 0 is the sum of w (k0 + k1 x + ...) value.
using Coefficients = std::array<float, kTerms>;

SIGHTLINE_CLONES("avx2")
void Weights(const FeatureFilter::Layout& layout, const Window& window, float* weights,
             Moments& moments) {
  const int vectors = (2 * window.radius + kLanes) / kLanes;
  const Lanes count = {0, 1, 2, 3, 4, 5, 6, 7};
  Lanes sums[5][5] = {};
  for (int di = -window.radius; di <= window.radius; ++di) {
    float* out = weights + static_cast<ptrdiff_t>(di + window.radius) * vectors * kLanes;
    const int row = window.row + di;
    if (row < 0 || row >= layout.rows) {
      std::fill_n(out, vectors * kLanes, 0.0F);
      continue;
    }
    const size_t start =
        static_cast<size_t>(row) * layout.width + layout.margin + window.column - window.radius;
    const float y = static_cast<float>(di) * window.inverse_reach;
    Lanes line[5] = {};
    for (int k = 0; k < vectors; ++k) {
      const size_t at = start + static_cast<size_t>(k) * kLanes;
      const Lanes x =
          (count + static_cast<float>(k * kLanes - window.radius)) * window.inverse_reach;
      const Lanes spatial = 1 - (x * x + y * y);
      const Lanes nx = *reinterpret_cast<const Lanes*>(layout.normal[0].data() + at) -
                       window.normal[0],
                  ny = *reinterpret_cast<const Lanes*>(layout.normal[1].data() + at) -
                       window.normal[1],
                  nz = *reinterpret_cast<const Lanes*>(layout.normal[2].data() + at) -
                       window.normal[2];
      const Lanes normal = 1 - (nx * nx + ny * ny + nz * nz) * window.inverse_normal2;
      const Lanes distance = (*reinterpret_cast<const Lanes*>(layout.position_m[0].data() + at) -
                              window.position_m[0]) *
                                 window.normal[0] +
                             (*reinterpret_cast<const Lanes*>(layout.position_m[1].data() + at) -
                              window.position_m[1]) *
                                 window.normal[1] +
                             (*reinterpret_cast<const Lanes*>(layout.position_m[2].data() + at) -
                              window.position_m[2]) *
                                 window.normal[2];
      const Lanes plane = 1 - distance * distance * window.inverse_plane2;
      const LaneMask use =
          (*reinterpret_cast<const Lanes*>(layout.material.data() + at) == window.material) &
          (spatial > 0) & (normal > 0) & (plane > 0);
      Lanes w = spatial * normal * normal * plane * plane *
                *reinterpret_cast<const Lanes*>(layout.samples.data() + at);
      w = use ? w : Lanes{};
      *reinterpret_cast<Lanes*>(out + static_cast<ptrdiff_t>(k) * kLanes) = w;
      Lanes power = w;
      line[0] += power;
      for (int a = 1; a < 5; ++a) {
        power *= x;
        line[a] += power;
      }
    }
    float power = 1;
    for (int b = 0; b < 5; ++b, power *= y) {
      for (int a = 0; a + b < 5; ++a) sums[a][b] += line[a] * power;
    }
  }
  for (int a = 0; a < 5; ++a) {
    for (int b = 0; a + b < 5; ++b) {
      moments[a][b] = 0;
      for (int lane = 0; lane < kLanes; ++lane) moments[a][b] += double{sums[a][b][lane]};
    }
  }
}

SIGHTLINE_CLONES("avx2")
void Apply(const FeatureFilter::Layout& layout, const Window& window, const float* weights,
           const Coefficients& linear, const Coefficients& square, float* plane,
           float* paraboloid) {
  const int vectors = (2 * window.radius + kLanes) / kLanes;
  const Lanes count = {0, 1, 2, 3, 4, 5, 6, 7};
  Lanes sums[2][kMaxStride] = {};
  for (int di = -window.radius; di <= window.radius; ++di) {
    const int row = window.row + di;
    if (row < 0 || row >= layout.rows) continue;
    const float* in = weights + static_cast<ptrdiff_t>(di + window.radius) * vectors * kLanes;
    const size_t start =
        static_cast<size_t>(row) * layout.width + layout.margin + window.column - window.radius;
    const float y = static_cast<float>(di) * window.inverse_reach;
    for (int k = 0; k < vectors; ++k) {
      const Lanes w = *reinterpret_cast<const Lanes*>(in + static_cast<ptrdiff_t>(k) * kLanes);
      const Lanes x =
          (count + static_cast<float>(k * kLanes - window.radius)) * window.inverse_reach;
      const Lanes first = w * (linear[0] + linear[1] * x + linear[2] * y);
      const Lanes second = w * (square[0] + square[2] * y + square[5] * y * y +
                                x * (square[1] + square[4] * y + square[3] * x));
      for (int c = 0; c < layout.stride; ++c) {
        const Lanes value = *reinterpret_cast<const Lanes*>(layout.values[c].data() + start +
                                                            static_cast<size_t>(k) * kLanes);
        sums[0][c] += first * value;
        sums[1][c] += second * value;
      }
    }
  }
  for (int c = 0; c < layout.stride; ++c) {
    plane[c] = paraboloid[c] = 0;
    for (int lane = 0; lane < kLanes; ++lane) {
      plane[c] += sums[0][c][lane];
      paraboloid[c] += sums[1][c][lane];
    }
  }
}

// First column of the inverse of the moment matrix of the first `terms` terms. Cholesky; false if
// the matrix is not positive definite.
bool Solve(const Moments& moments, int terms, double ridge, Coefficients& coefficients) {
  constexpr int kA[kTerms] = {0, 1, 0, 2, 1, 0}, kB[kTerms] = {0, 0, 1, 0, 1, 2};
  double l[kTerms][kTerms], z[kTerms];
  for (int i = 0; i < terms; ++i) {
    for (int j = 0; j <= i; ++j) {
      double v = moments[kA[i] + kA[j]][kB[i] + kB[j]];
      if (i == j && i > 0) v += ridge * moments[0][0];
      for (int k = 0; k < j; ++k) v -= l[i][k] * l[j][k];
      if (i == j) {
        if (!(v > 1e-12 * moments[0][0])) return false;
        l[i][i] = std::sqrt(v);
      } else {
        l[i][j] = v / l[j][j];
      }
    }
    z[i] = i == 0 ? 1 : 0;
    for (int k = 0; k < i; ++k) z[i] -= l[i][k] * z[k];
    z[i] /= l[i][i];
  }
  coefficients = {};
  for (int i = terms - 1; i >= 0; --i) {
    for (int k = i + 1; k < terms; ++k) z[i] -= l[k][i] * z[k];
    z[i] /= l[i][i];
    coefficients[i] = static_cast<float>(z[i]);
  }
  return true;
}

}  // namespace

FeatureFilter::FeatureFilter(const PixelValues& noisy, const std::vector<PixelFeatures>& features,
                             const std::vector<int>& samples, int radius_px)
    : noisy_(noisy), features_(features), radius_px_(radius_px) {
  assert(noisy.stride <= kMaxStride);
  Layout& l = layout_;
  l.columns = noisy.columns_px;
  l.rows = noisy.rows_px;
  l.stride = noisy.stride;
  l.margin = radius_px + 1 + kLanes;
  l.width = l.columns + 2 * l.margin;
  const size_t size = static_cast<size_t>(l.width) * l.rows;
  l.material.assign(size, 0);
  l.samples.assign(size, 0);
  for (int axis = 0; axis < 3; ++axis) {
    l.position_m[axis].assign(size, 0);
    l.normal[axis].assign(size, 0);
  }
  l.values.assign(l.stride, std::vector<float>(size, 0));
  for (int i = 0; i < l.rows; ++i) {
    for (int j = 0; j < l.columns; ++j) {
      const size_t pixel = static_cast<size_t>(i) * l.columns + j;
      const size_t to = static_cast<size_t>(i) * l.width + l.margin + j;
      const PixelFeatures& f = features[pixel];
      if (!f.uniform || f.textured || f.material == 0xffff) continue;
      l.material[to] = static_cast<float>(f.material) + 1;
      l.samples[to] = static_cast<float>(samples[pixel]);
      for (int axis = 0; axis < 3; ++axis) {
        l.position_m[axis][to] = f.position_m[axis];
        l.normal[axis][to] = f.normal[axis];
      }
      for (int c = 0; c < l.stride; ++c) l.values[c][to] = noisy.At(pixel)[c];
    }
  }
}

void FeatureFilter::Rows(int first_row, int end_row, PixelValues& plane,
                         PixelValues& paraboloid) const {
  const int side = 2 * (radius_px_ + 1) + 1;
  std::vector<float> weights(static_cast<size_t>(side) * (side + kLanes));
  for (int i = first_row; i < end_row; ++i) {
    for (int j = 0; j < layout_.columns; ++j) {
      const size_t pixel = static_cast<size_t>(i) * layout_.columns + j;
      const PixelFeatures& centre = features_[pixel];
      const float* own = noisy_.At(pixel);
      std::copy(own, own + layout_.stride, plane.At(pixel));
      std::copy(own, own + layout_.stride, paraboloid.At(pixel));
      if (!centre.uniform || centre.textured || centre.material == 0xffff ||
          centre.footprint_m <= 0) {
        continue;
      }
      auto reach = static_cast<float>(radius_px_);
      if (centre.inverse_distance_1_m > 0) {
        reach =
            std::min(reach, kDistanceFraction / (centre.inverse_distance_1_m * centre.footprint_m));
      }
      if (reach < 2) continue;
      Window window;
      window.row = i;
      window.column = j;
      window.radius = static_cast<int>(std::ceil(reach));
      window.inverse_reach = 1 / (reach + 1);
      window.material = static_cast<float>(centre.material) + 1;
      for (int axis = 0; axis < 3; ++axis) {
        window.position_m[axis] = centre.position_m[axis];
        window.normal[axis] = centre.normal[axis];
      }
      window.inverse_normal2 = 1 / (kNormalScale * kNormalScale);
      const float inverse_plane = 1 / (kPlaneScale_px * centre.footprint_m);
      window.inverse_plane2 = inverse_plane * inverse_plane;
      Moments moments;
      Weights(layout_, window, weights.data(), moments);
      // Ridges keep windows of a few pixels in a row solvable.
      Coefficients linear, square;
      const double pixel2 = double{window.inverse_reach} * window.inverse_reach;
      if (!Solve(moments, 3, 1e-3 * pixel2, linear)) continue;
      if (!Solve(moments, kTerms, 1e-3 * pixel2 * pixel2, square)) square = linear;
      Apply(layout_, window, weights.data(), linear, square, plane.At(pixel), paraboloid.At(pixel));
    }
  }
}

}  // namespace sightline
