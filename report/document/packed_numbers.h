// SPDX-License-Identifier: Apache-2.0
// Long lists of numbers as bytes of a report (report_scene.proto).
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "absl/strings/string_view.h"

namespace sightline {

// Differences to the number `stride` places before, modulo the number's size; the lowest bytes of
// all differences, then the next ones; compressed by zlib. Neighbours in the list that are alike
// cost few bytes.
std::string PackNumbers(std::span<const uint8_t> numbers, size_t stride = 1);
std::string PackNumbers(std::span<const uint16_t> numbers, size_t stride = 1);
std::string PackNumbers(std::span<const uint32_t> numbers, size_t stride = 1);

// Bytes compressed by zlib, without differences.
std::string PackBytes(absl::string_view bytes);

}  // namespace sightline
