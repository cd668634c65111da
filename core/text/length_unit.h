// SPDX-License-Identifier: Apache-2.0
// Length units of files that state none: m, cm, mm, um and inch, with the spellings people use.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "absl/status/statusor.h"

namespace sightline {

// "m", "cm", "mm", "um" or "inch", as inspections and requests carry the unit, for a symbol or a
// word: `in`, `"`, `inches`, `Millimetre`, `µm`. INVALID_ARGUMENT names those that are known.
absl::StatusOr<std::string> LengthUnitNamed(std::string_view text);

// Metres of one unit, for the same texts; none for any other.
std::optional<double> MetresPerUnit(std::string_view text);

}  // namespace sightline
