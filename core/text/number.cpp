// SPDX-License-Identifier: Apache-2.0
#include "core/text/number.h"

#include <charconv>
#include <cmath>
#include <system_error>

#include "absl/strings/ascii.h"
#include "absl/strings/charconv.h"
#include "absl/strings/str_cat.h"
#include "core/text/printable.h"

namespace sightline {
namespace {

constexpr size_t kMostQuotedCharacters = 40;

absl::Status Refused(std::string_view text, const std::string& what) {
  return absl::InvalidArgumentError(absl::StrCat("must be ", what, ", is ", QuotedExcerpt(text)));
}

bool IsDigitAt(std::string_view text, size_t place) {
  return place < text.size() && absl::ascii_isdigit(static_cast<unsigned char>(text[place]));
}

template <typename Number>
absl::StatusOr<Number> ParseDigits(std::string_view text, bool may_be_negative,
                                   const std::string& what) {
  const std::string_view digits =
      text.substr(may_be_negative && !text.empty() && text.front() == '-' ? 1 : 0);
  if (digits.empty() || digits.find_first_not_of("0123456789") != std::string_view::npos) {
    return Refused(text, what);
  }
  if (HasLeadingZeros(text)) return Refused(text, absl::StrCat(what, " without leading zeros"));
  Number value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc()) return Refused(text, absl::StrCat(what, " of at most 64 bits"));
  return value;
}

}  // namespace

std::string QuotedExcerpt(std::string_view text) {
  const bool whole = text.size() <= kMostQuotedCharacters;
  return absl::StrCat("\"", Printable(text.substr(0, kMostQuotedCharacters)), whole ? "" : "...",
                      "\"");
}

bool HasLeadingZeros(std::string_view text) {
  const size_t first = !text.empty() && (text.front() == '-' || text.front() == '+') ? 1 : 0;
  return first < text.size() && text[first] == '0' && IsDigitAt(text, first + 1);
}

absl::StatusOr<double> ParseReal(std::string_view text) {
  static constexpr char kWhat[] = "a finite decimal number";
  // absl::from_chars also knows nan, inf and, without this check, a second sign.
  std::string_view number = text;
  if (!number.empty() && number.front() == '+') number.remove_prefix(1);
  if (number.empty() || number.front() == '+' ||
      (number.size() < text.size() && number.front() == '-') ||
      number.find_first_not_of("0123456789+-.eE") != std::string_view::npos) {
    return Refused(text, kWhat);
  }
  double value = 0;
  const char* end = number.data() + number.size();
  const absl::from_chars_result result = absl::from_chars(number.data(), end, value);
  if (result.ptr != end ||
      (result.ec != std::errc() && result.ec != std::errc::result_out_of_range)) {
    return Refused(text, kWhat);
  }
  if (result.ec == std::errc::result_out_of_range && std::abs(value) > 1) {
    return Refused(text, absl::StrCat(kWhat, " of at most 1.8e308"));
  }
  return value;
}

absl::StatusOr<std::int64_t> ParseWhole(std::string_view text) {
  return ParseDigits<std::int64_t>(text, /*may_be_negative=*/true, "a whole number");
}

absl::StatusOr<std::uint64_t> ParseUnsigned(std::string_view text) {
  return ParseDigits<std::uint64_t>(text, /*may_be_negative=*/false,
                                    "a whole number without a sign");
}

}  // namespace sightline
