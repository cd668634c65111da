// SPDX-License-Identifier: Apache-2.0
// Raw numbers as a greyscale PNG, without any conversion.
#pragma once

#include <cstdint>
#include <string>

#include "absl/status/statusor.h"
#include "core/image/image.h"

namespace sightline {

// The bytes of the file. `file_bits`: 8 or 16 a pixel; all numbers must fit. INTERNAL: libpng
// failed, with its reason.
absl::StatusOr<std::string> EncodeRawPng(const Image<uint16_t>& raw_dn, int file_bits);

}  // namespace sightline
