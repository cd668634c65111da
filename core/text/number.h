// SPDX-License-Identifier: Apache-2.0
// Numbers in text, of options, requests and data files: read in one way or refused.
//
// No locale, base prefix or special value is known: `0x8`, `nan`, `inf`, `1,5` and text behind the
// number are refused. Errors are INVALID_ARGUMENT with a reason like
// `must be a whole number, is "1e3"`; the caller adds the file and the field.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "absl/status/statusor.h"

namespace sightline {

// A finite number in decimal digits with an optional sign, point and exponent: `-0.5`, `+2.`,
// `1e-3`, `007`. A number that is too small for a double is zero, one that is too large an error.
absl::StatusOr<double> ParseReal(std::string_view text);

// A whole number in [-2^63, 2^63 - 1]: decimal digits with an optional `-`. Leading zeros (`010`)
// are refused, since other programs read them as octal.
absl::StatusOr<std::int64_t> ParseWhole(std::string_view text);

// A whole number in [0, 2^64 - 1] in the same form, without a sign.
absl::StatusOr<std::uint64_t> ParseUnsigned(std::string_view text);

// Whether a number begins with a zero that other programs read as a mark of octal: `010`, `-007.5`.
// Files may pad numbers (ParseReal reads them); options of programs may not.
bool HasLeadingZeros(std::string_view text);

// The text in quotation marks for a message: at most 40 characters, control characters escaped.
std::string QuotedExcerpt(std::string_view text);

}  // namespace sightline
