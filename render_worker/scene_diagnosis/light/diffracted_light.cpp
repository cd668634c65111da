// SPDX-License-Identifier: Apache-2.0
#include "render_worker/scene_diagnosis/light/diffracted_light.h"

#include <algorithm>

namespace sightline {
namespace {

// Half width of the neighbourhood that counts as near [px]: chosen wider than the core of a focused
// image point.
constexpr int kNear_px = 2;

float LargestNear(const Image<float>& radiance, int row, int column) {
  const int last_row = std::min(radiance.rows_px - 1, row + kNear_px);
  const int last_column = std::min(radiance.columns_px - 1, column + kNear_px);
  float largest = 0;
  for (int m = std::max(0, row - kNear_px); m <= last_row; ++m) {
    for (int n = std::max(0, column - kNear_px); n <= last_column; ++n) {
      largest = std::max(largest, radiance.At(m, n));
    }
  }
  return largest;
}

}  // namespace

Image<double> DiffractedElectrons(const Image<double>& electrons, const Image<float>& radiance) {
  double light = 0, geometric = 0;
  for (const double value : electrons.values) light += value;
  for (const float value : radiance.values) geometric += value;
  Image<double> diffracted = electrons;
  if (geometric <= 0) return diffracted;
  for (int i = 0; i < diffracted.rows_px; ++i) {
    for (int j = 0; j < diffracted.columns_px; ++j) {
      diffracted.At(i, j) =
          std::max(0.0, electrons.At(i, j) - light / geometric * LargestNear(radiance, i, j));
    }
  }
  return diffracted;
}

}  // namespace sightline
