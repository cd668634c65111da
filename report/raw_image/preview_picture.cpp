// SPDX-License-Identifier: Apache-2.0
#include "report/raw_image/preview_picture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "absl/strings/str_format.h"
#include "core/statistics/order_statistics.h"

namespace sightline {
namespace {

constexpr double kBlackQuantile = 0.01, kWhiteQuantile = 0.999;
constexpr double kGamma = 2.2;
constexpr double kMostBalance = 4;

// Values of one channel for every pixel: its own number, or its cell's mean of two greens, red or
// blue.
std::vector<float> Channel(const RawPng& raw, bool bayer, int channel) {
  std::vector<float> values;
  values.reserve(raw.values_dn.size());
  for (int row = 0; row < raw.rows_px; ++row) {
    for (int column = 0; column < raw.columns_px; ++column) {
      if (!bayer) {
        values.push_back(raw.At(row, column));
        continue;
      }
      const int top = std::min(row & ~1, raw.rows_px - 2);
      const int left = std::min(column & ~1, raw.columns_px - 2);
      values.push_back(channel == 0   ? raw.At(top, left)
                       : channel == 2 ? raw.At(top + 1, left + 1)
                                      : 0.5f * static_cast<float>(raw.At(top, left + 1) +
                                                                  raw.At(top + 1, left)));
    }
  }
  return values;
}

}  // namespace

absl::StatusOr<std::string> PreviewPng(const RawPng& raw, bool bayer) {
  // Smaller than a colour cell of 2 x 2 pixels: there is no colour information.
  bayer = bayer && raw.columns_px >= 2 && raw.rows_px >= 2;
  const int channels = bayer ? 3 : 1;
  std::vector<std::vector<float>> light;  // above black
  std::vector<double> median;
  for (int c = 0; c < channels; ++c) {
    light.push_back(Channel(raw, bayer, c));
    std::vector<float> sorted = light.back();
    const double black = LowerQuantile(sorted, kBlackQuantile);
    median.push_back(std::max(0.0, LowerQuantile(sorted, 0.5) - black));
    for (float& value : light.back()) {
      value = std::max(0.0f, value - static_cast<float>(black));
    }
  }
  double white = 0;
  for (int c = 0; c < channels; ++c) {
    // Without ambient light the channels cannot be balanced.
    const bool balanced = channels == 3 && median[static_cast<size_t>(c)] >= 2 && median[1] >= 2;
    const double gain = balanced ? std::clamp(median[1] / median[static_cast<size_t>(c)],
                                              1 / kMostBalance, kMostBalance)
                                 : 1;
    for (float& value : light[static_cast<size_t>(c)]) value *= static_cast<float>(gain);
    const double bright = LowerQuantile(light[static_cast<size_t>(c)], kWhiteQuantile);
    white = std::max(white, bright);
  }
  white = std::max(white, 1.0);
  std::vector<uint8_t> values;
  values.reserve(raw.values_dn.size() * static_cast<size_t>(channels));
  for (size_t i = 0; i < raw.values_dn.size(); ++i) {
    for (const std::vector<float>& channel : light) {
      const double signal = std::min(1.0, channel[i] / white);
      values.push_back(static_cast<uint8_t>(std::lround(255 * std::pow(signal, 1 / kGamma))));
    }
  }
  return EncodePng(values, raw.columns_px, raw.rows_px, bayer,
                   absl::StrFormat("Picture for people, not data: darkest 1 %% black, brightest "
                                   "0.1 %% white (%.0f DN above black), gamma %.1f.",
                                   white, kGamma));
}

}  // namespace sightline
