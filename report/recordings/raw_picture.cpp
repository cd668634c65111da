// SPDX-License-Identifier: Apache-2.0
#include "report/recordings/raw_picture.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "core/statistics/order_statistics.h"
#include "report/raw_image/raw_png.h"

namespace sightline {
namespace {

constexpr uint32_t kMaxColumns = 640;
constexpr uint64_t kMaxPixels = uint64_t{1} << 27;  // a damaged header shall not take all memory

bool StaysInside(const std::string& file) {
  const std::filesystem::path path(file);
  if (file.empty() || path.is_absolute()) return false;
  return std::none_of(path.begin(), path.end(), [](const auto& part) { return part == ".."; });
}

}  // namespace

std::string RawPicturePng(const std::string& folder, const std::string& file) {
  if (folder.empty() || !StaysInside(file)) return "";
  const auto raw = ReadRawPng((std::filesystem::path(folder) / file).string(), kMaxPixels);
  if (!raw.ok()) return "";
  const auto columns = static_cast<uint32_t>(raw->columns_px);
  const auto rows = static_cast<uint32_t>(raw->rows_px);
  // Averages square blocks, so that a thin line stays visible.
  const uint32_t block = (columns + kMaxColumns - 1) / kMaxColumns;
  const uint32_t shown_columns = columns / block, shown_rows = std::max(1u, rows / block);
  std::vector<float> means(static_cast<size_t>(shown_columns) * shown_rows);
  for (uint32_t row = 0; row < shown_rows; ++row) {
    for (uint32_t column = 0; column < shown_columns; ++column) {
      double sum = 0;
      uint32_t count = 0;
      for (uint32_t i = row * block; i < std::min(rows, (row + 1) * block); ++i) {
        for (uint32_t j = column * block; j < (column + 1) * block; ++j) {
          sum += raw->values_dn[static_cast<size_t>(i) * columns + j];
          ++count;
        }
      }
      means[static_cast<size_t>(row) * shown_columns + column] = static_cast<float>(sum / count);
    }
  }
  const double black = LowerQuantile(means, 0.05);
  const double white = std::max<double>(LowerQuantile(means, 0.998), black + 1);
  std::vector<uint8_t> grey(means.size());
  for (size_t i = 0; i < means.size(); ++i) {
    const double signal = std::clamp((means[i] - black) / (white - black), 0.0, 1.0);
    grey[i] = static_cast<uint8_t>(std::lround(255 * std::sqrt(signal)));
  }
  const auto png =
      EncodePng(grey, static_cast<int>(shown_columns), static_cast<int>(shown_rows), false);
  return png.ok() ? *png : "";
}

}  // namespace sightline
