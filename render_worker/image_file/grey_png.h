// SPDX-License-Identifier: Apache-2.0
// Small pictures for reports.
#pragma once

#include <cstdint>
#include <string>

#include "absl/status/statusor.h"
#include "core/image/image.h"

namespace sightline {

// Bytes of an 8-bit grey PNG. INTERNAL: it cannot be encoded.
absl::StatusOr<std::string> EncodeGreyPng(const Image<uint8_t>& image);

}  // namespace sightline
