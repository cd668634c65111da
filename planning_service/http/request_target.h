// SPDX-License-Identifier: Apache-2.0
// Targets of HTTP requests: "/v1/jobs/ID?page_size=10".
#pragma once

#include <map>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace sightline {

struct RequestTarget {
  std::string authority;          // of "http://HOST/..." only; else empty
  std::vector<std::string> path;  // decoded segments; "/" has one empty one
  std::multimap<std::string, std::string> query;
};

// INVALID_ARGUMENT: no path, broken percent-encoding, or control characters.
absl::StatusOr<RequestTarget> ParseRequestTarget(absl::string_view target);

// INVALID_ARGUMENT: a '%' without two hexadecimal digits.
absl::StatusOr<std::string> PercentDecode(absl::string_view text);

// Everything but letters, digits and "-._~" is encoded; '/' stays if `keep_slashes`.
std::string PercentEncode(absl::string_view text, bool keep_slashes);

bool HasControlCharacters(absl::string_view text);
bool IsValidUtf8(absl::string_view text);

}  // namespace sightline
