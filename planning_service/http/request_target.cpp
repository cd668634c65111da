// SPDX-License-Identifier: Apache-2.0
#include "planning_service/http/request_target.h"

#include <algorithm>
#include <cstdint>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "absl/strings/str_split.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

int HexDigit(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

absl::StatusOr<std::string> DecodeQueryText(absl::string_view text) {
  return PercentDecode(absl::StrReplaceAll(text, {{"+", " "}}));
}

}  // namespace

absl::StatusOr<std::string> PercentDecode(absl::string_view text) {
  std::string decoded;
  for (size_t i = 0; i < text.size(); ++i) {
    if (text[i] != '%') {
      decoded += text[i];
      continue;
    }
    const int high = i + 2 < text.size() ? HexDigit(text[i + 1]) : -1;
    const int low = i + 2 < text.size() ? HexDigit(text[i + 2]) : -1;
    if (high < 0 || low < 0) {
      return absl::InvalidArgumentError(
          "a % in the URL must be followed by two hexadecimal digits");
    }
    decoded += static_cast<char>(high * 16 + low);
    i += 2;
  }
  return decoded;
}

std::string PercentEncode(absl::string_view text, bool keep_slashes) {
  std::string encoded;
  for (const char c : text) {
    if (absl::ascii_isalnum(static_cast<unsigned char>(c)) || c == '-' || c == '.' || c == '_' ||
        c == '~' || (c == '/' && keep_slashes)) {
      encoded += c;
    } else {
      absl::StrAppend(&encoded, "%", absl::Hex(static_cast<unsigned char>(c), absl::kZeroPad2));
    }
  }
  return encoded;
}

bool HasControlCharacters(absl::string_view text) {
  return std::any_of(text.begin(), text.end(),
                     [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7f; });
}

bool IsValidUtf8(absl::string_view text) {
  for (size_t i = 0; i < text.size();) {
    const auto first = static_cast<unsigned char>(text[i]);
    const size_t length = first < 0x80           ? 1
                          : (first >> 5) == 0x06 ? 2
                          : (first >> 4) == 0x0e ? 3
                          : (first >> 3) == 0x1e ? 4
                                                 : 0;
    if (length == 0 || i + length > text.size()) return false;
    uint32_t code = length == 1 ? first : first & (0x7fu >> length);
    for (size_t k = 1; k < length; ++k) {
      const auto next = static_cast<unsigned char>(text[i + k]);
      if ((next >> 6) != 0x02) return false;
      code = (code << 6) | (next & 0x3fu);
    }
    // Overlong encodings and surrogates (halves of a UTF-16 pair) are not valid UTF-8.
    constexpr uint32_t kLeast[] = {0, 0, 0x80, 0x800, 0x10000};
    if (code < kLeast[length] || code > 0x10ffff || (code >= 0xd800 && code <= 0xdfff)) {
      return false;
    }
    i += length;
  }
  return true;
}

absl::StatusOr<RequestTarget> ParseRequestTarget(absl::string_view target) {
  RequestTarget parsed;
  for (const absl::string_view scheme : {"http://", "https://"}) {
    if (!absl::StartsWithIgnoreCase(target, scheme)) continue;
    target.remove_prefix(scheme.size());
    const size_t end = std::min(target.find_first_of("/?"), target.size());
    parsed.authority = std::string(target.substr(0, end));
    target.remove_prefix(end);
    break;
  }
  target = target.substr(0, target.find('#'));
  const size_t question = target.find('?');
  const absl::string_view path = target.substr(0, question);
  if (path.empty() || path.front() != '/') {
    return absl::InvalidArgumentError("the request's target must be a path that begins with /");
  }
  for (const absl::string_view segment : absl::StrSplit(path.substr(1), '/')) {
    SIGHTLINE_ASSIGN_OR_RETURN(std::string decoded, PercentDecode(segment));
    if (HasControlCharacters(decoded) || !IsValidUtf8(decoded)) {
      return absl::InvalidArgumentError("the URL's path must be UTF-8 without control characters");
    }
    parsed.path.push_back(std::move(decoded));
  }
  if (question == absl::string_view::npos) return parsed;
  for (const absl::string_view pair :
       absl::StrSplit(target.substr(question + 1), '&', absl::SkipEmpty())) {
    const size_t equals = pair.find('=');
    SIGHTLINE_ASSIGN_OR_RETURN(std::string name, DecodeQueryText(pair.substr(0, equals)));
    SIGHTLINE_ASSIGN_OR_RETURN(std::string value, DecodeQueryText(equals == absl::string_view::npos
                                                                      ? absl::string_view()
                                                                      : pair.substr(equals + 1)));
    if (HasControlCharacters(value) || !IsValidUtf8(name) || !IsValidUtf8(value)) {
      return absl::InvalidArgumentError("the URL's query must be UTF-8 without control characters");
    }
    parsed.query.emplace(std::move(name), std::move(value));
  }
  return parsed;
}

}  // namespace sightline
