// SPDX-License-Identifier: Apache-2.0
#include "render_worker/sensor/demosaic.h"

#include <cstdlib>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"

namespace sightline {
namespace {

// Place of a mirrored pixel in [0, size): -1 -> 1, size -> size - 2.
int Mirror(int place, int size) {
  if (place < 0) place = -place;
  return place >= size ? 2 * (size - 1) - place : place;
}

using Kernel = std::array<std::array<int, 5>, 5>;

// Weights times 16 (bilinear as well): at a pixel of another colour, the value of ...
struct Kernels {
  Kernel green;         // green at red or blue
  Kernel along_row;     // red (blue) at green whose row has red (blue)
  Kernel along_column;  // red (blue) at green whose column has red (blue)
  Kernel diagonal;      // red at blue, blue at red
};

constexpr Kernels kBilinear = {
    {{{0, 0, 0, 0, 0}, {0, 0, 4, 0, 0}, {0, 4, 0, 4, 0}, {0, 0, 4, 0, 0}, {0, 0, 0, 0, 0}}},
    {{{0, 0, 0, 0, 0}, {0, 0, 0, 0, 0}, {0, 8, 0, 8, 0}, {0, 0, 0, 0, 0}, {0, 0, 0, 0, 0}}},
    {{{0, 0, 0, 0, 0}, {0, 0, 8, 0, 0}, {0, 0, 0, 0, 0}, {0, 0, 8, 0, 0}, {0, 0, 0, 0, 0}}},
    {{{0, 0, 0, 0, 0}, {0, 4, 0, 4, 0}, {0, 0, 0, 0, 0}, {0, 4, 0, 4, 0}, {0, 0, 0, 0, 0}}}};

constexpr Kernels kMalvar = {
    {{{0, 0, -2, 0, 0}, {0, 0, 4, 0, 0}, {-2, 4, 8, 4, -2}, {0, 0, 4, 0, 0}, {0, 0, -2, 0, 0}}},
    {{{0, 0, 1, 0, 0}, {0, -2, 0, -2, 0}, {-2, 8, 10, 8, -2}, {0, -2, 0, -2, 0}, {0, 0, 1, 0, 0}}},
    {{{0, 0, -2, 0, 0}, {0, -2, 8, -2, 0}, {1, 0, 10, 0, 1}, {0, -2, 8, -2, 0}, {0, 0, -2, 0, 0}}},
    {{{0, 0, -3, 0, 0}, {0, 4, 0, 4, 0}, {-3, 0, 12, 0, -3}, {0, 4, 0, 4, 0}, {0, 0, -3, 0, 0}}}};

float Apply(const Kernel& kernel, const Image<uint16_t>& raw, int row, int column) {
  int sum = 0;
  for (int i = -2; i <= 2; ++i) {
    const uint16_t* values = raw.Row(Mirror(row + i, raw.rows_px));
    for (int j = -2; j <= 2; ++j) {
      sum += kernel[i + 2][j + 2] * values[Mirror(column + j, raw.columns_px)];
    }
  }
  return static_cast<float>(sum) / 16;
}

}  // namespace

absl::StatusOr<RgbImage> Demosaic(const Image<uint16_t>& raw_dn, int row_px, int column_px,
                                  DemosaicMethod method) {
  if (raw_dn.rows_px < 3 || raw_dn.columns_px < 3) {
    return absl::InvalidArgumentError(absl::StrCat("demosaic: the image has ", raw_dn.columns_px,
                                                   " x ", raw_dn.rows_px,
                                                   " pixels, must have at least 3 x 3"));
  }
  const Kernels& kernels = method == DemosaicMethod::kBilinear ? kBilinear : kMalvar;
  RgbImage rgb;
  for (Image<float>& plane : rgb) plane = Image<float>(raw_dn.columns_px, raw_dn.rows_px);
  auto& [red, green, blue] = rgb;
  for (int i = 0; i < raw_dn.rows_px; ++i) {
    const bool blue_row = (row_px + i) & 1;
    for (int j = 0; j < raw_dn.columns_px; ++j) {
      const bool blue_column = (column_px + j) & 1;
      const float own = raw_dn.At(i, j);
      // The colour of this row, and the other one.
      Image<float>& row_colour = blue_row ? blue : red;
      Image<float>& other_colour = blue_row ? red : blue;
      if (blue_row != blue_column) {
        green.At(i, j) = own;
        row_colour.At(i, j) = Apply(kernels.along_row, raw_dn, i, j);
        other_colour.At(i, j) = Apply(kernels.along_column, raw_dn, i, j);
      } else {
        row_colour.At(i, j) = own;
        green.At(i, j) = Apply(kernels.green, raw_dn, i, j);
        other_colour.At(i, j) = Apply(kernels.diagonal, raw_dn, i, j);
      }
    }
  }
  return rgb;
}

std::array<double, 3> GreyWorldFactors(const RgbImage& image_dn, double black_level_dn,
                                       double saturation_dn) {
  std::array<double, 3> sum{};
  for (size_t i = 0; i < image_dn[0].values.size(); ++i) {
    bool saturated = false;
    for (const Image<float>& plane : image_dn) {
      saturated |= saturation_dn > 0 && plane.values[i] >= saturation_dn;
    }
    if (saturated) continue;
    for (int c = 0; c < 3; ++c) sum[c] += image_dn[c].values[i] - black_level_dn;
  }
  if (!(sum[0] > 0 && sum[1] > 0 && sum[2] > 0)) return {1, 1, 1};
  return {sum[1] / sum[0], 1, sum[1] / sum[2]};
}

void WhiteBalance(const std::array<double, 3>& factors, double black_level_dn, RgbImage* image_dn) {
  for (int c = 0; c < 3; ++c) {
    for (float& value : (*image_dn)[c].values) {
      value = static_cast<float>(factors[c] * (value - black_level_dn) + black_level_dn);
    }
  }
}

}  // namespace sightline
