// SPDX-License-Identifier: Apache-2.0
// Text that every database accepts: valid UTF-8 without NUL.
#pragma once

#include <string>

#include "absl/strings/string_view.h"

namespace sightline {

bool IsPlainText(absl::string_view text);

// The text with U+FFFD in place of invalid bytes, cut to at most `max_bytes` between characters.
std::string ToPlainText(absl::string_view text, size_t max_bytes);

}  // namespace sightline
