// SPDX-License-Identifier: Apache-2.0
#include "core/laser_line/ridge_score.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <numbers>
#include <numeric>

namespace sightline {
namespace {

// Place mirrored about the edge between the first (last) pixel and the outside.
int Mirror(int place, int size) {
  while (place < 0 || place >= size) place = place < 0 ? -1 - place : 2 * size - 1 - place;
  return place;
}

Image<float> AlongColumns(const Image<float>& image, const std::vector<float>& kernel) {
  const int radius = static_cast<int>(kernel.size() / 2);
  Image<float> result(image.columns_px, image.rows_px);
  for (int row = 0; row < image.rows_px; ++row) {
    float* out = result.Row(row);
    for (int k = -radius; k <= radius; ++k) {
      // Correlation with the mirrored kernel is convolution.
      const float weight = kernel[radius - k];
      const float* in = image.Row(Mirror(row + k, image.rows_px));
      for (int column = 0; column < image.columns_px; ++column) out[column] += weight * in[column];
    }
  }
  return result;
}

Image<float> AlongRows(const Image<float>& image, const std::vector<float>& kernel) {
  const int radius = static_cast<int>(kernel.size() / 2);
  const int columns = image.columns_px;
  Image<float> result(columns, image.rows_px);
  std::vector<float> padded(columns + 2 * radius);
  for (int row = 0; row < image.rows_px; ++row) {
    const float* in = image.Row(row);
    for (int j = 0; j < columns + 2 * radius; ++j) padded[j] = in[Mirror(j - radius, columns)];
    float* out = result.Row(row);
    for (int k = -radius; k <= radius; ++k) {
      const float weight = kernel[radius - k];
      const float* shifted = padded.data() + radius + k;
      for (int column = 0; column < columns; ++column) out[column] += weight * shifted[column];
    }
  }
  return result;
}

}  // namespace

GaussianDerivatives MakeGaussianDerivatives(double sigma_px) {
  assert(sigma_px > 0);
  GaussianDerivatives d;
  d.radius_px = static_cast<int>(std::ceil(4 * sigma_px + 0.5));
  const double s2 = sigma_px * sigma_px;
  const auto integral = [&](double x) {
    return 0.5 * std::erf(x / (sigma_px * std::numbers::sqrt2));
  };
  const auto gaussian = [&](double x) {
    return std::exp(-x * x / (2 * s2)) / (sigma_px * std::sqrt(2 * std::numbers::pi));
  };
  const auto slope = [&](double x) { return -x / s2 * gaussian(x); };
  std::vector<double> smooth, first, second;
  double smooth_sum = 0, second_sum = 0;
  for (int k = -d.radius_px; k <= d.radius_px; ++k) {
    smooth.push_back(integral(k + 0.5) - integral(k - 0.5));
    first.push_back(gaussian(k + 0.5) - gaussian(k - 0.5));
    second.push_back(slope(k + 0.5) - slope(k - 0.5));
    smooth_sum += smooth.back();
    second_sum += second.back();
  }
  for (size_t i = 0; i < smooth.size(); ++i) {
    d.smooth.push_back(static_cast<float>(smooth[i] / smooth_sum));
    d.first.push_back(static_cast<float>(first[i]));
    // Subtracting the mean makes the response of the truncated kernel to a constant zero.
    d.second.push_back(static_cast<float>(second[i] - second_sum / second.size()));
  }
  return d;
}

double RidgeNoise(double sigma_px) {
  const GaussianDerivatives d = MakeGaussianDerivatives(sigma_px);
  const auto energy = [](const std::vector<float>& kernel) {
    return std::inner_product(kernel.begin(), kernel.end(), kernel.begin(), 0.0);
  };
  return std::sqrt(energy(d.second) * energy(d.smooth));
}

Image<float> RidgeScore(const Image<float>& image_dn, double sigma_px) {
  const GaussianDerivatives d = MakeGaussianDerivatives(sigma_px);
  Image<float> score = AlongRows(AlongColumns(image_dn, d.second), d.smooth);
  const Image<float> i_uu = AlongRows(AlongColumns(image_dn, d.smooth), d.second);
  const Image<float> i_uv = AlongRows(AlongColumns(image_dn, d.first), d.first);
  for (size_t i = 0; i < score.values.size(); ++i) {
    const float mean = (score.values[i] + i_uu.values[i]) / 2;
    const float half_difference = (score.values[i] - i_uu.values[i]) / 2;
    const float root =
        std::sqrt(half_difference * half_difference + i_uv.values[i] * i_uv.values[i]);
    // The eigenvalues are mean -+ root; the lower one is the larger in magnitude if mean < 0.
    score.values[i] = mean < 0 ? root - mean : 0;
  }
  return score;
}

}  // namespace sightline
