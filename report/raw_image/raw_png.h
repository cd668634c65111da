// SPDX-License-Identifier: Apache-2.0
// Reads raw sensor values from PNG files, and writes pictures for screens.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace sightline {

struct RawPng {
  int columns_px = 0, rows_px = 0;
  std::vector<uint16_t> values_dn;  // row by row

  uint16_t At(int row, int column) const {
    return values_dn[static_cast<size_t>(row) * static_cast<size_t>(columns_px) +
                     static_cast<size_t>(column)];
  }
};

// Reads a greyscale image as core/image does. INTERNAL names the file without its folder if it is
// no such image, is damaged, or has more than `max_pixels`.
absl::StatusOr<RawPng> ReadRawPng(const std::string& file, uint64_t max_pixels);

// 8-bit PNG of grey or red, green, blue values, row by row; `description` (may be empty) becomes
// its text "Description". INTERNAL if encoding fails.
absl::StatusOr<std::string> EncodePng(const std::vector<uint8_t>& values, int columns_px,
                                      int rows_px, bool colour,
                                      const std::string& description = "");

}  // namespace sightline
