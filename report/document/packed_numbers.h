// SPDX-License-Identifier: Apache-2.0
// Packs long lists of numbers into bytes of a report (report_scene.proto).
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "absl/strings/string_view.h"

namespace sightline {

// Takes differences to the number `stride` positions before, modulo the number's size, stores the
// lowest bytes of all differences, then the next ones, and compresses them with zlib. Similar
// neighbours in the list cost few bytes.
std::string PackNumbers(std::span<const uint8_t> numbers, size_t stride = 1);
std::string PackNumbers(std::span<const uint16_t> numbers, size_t stride = 1);
std::string PackNumbers(std::span<const uint32_t> numbers, size_t stride = 1);

// Bytes compressed by zlib, without differences.
std::string PackBytes(absl::string_view bytes);

}  // namespace sightline
