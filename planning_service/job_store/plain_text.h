// SPDX-License-Identifier: Apache-2.0
// Text that every database takes: valid UTF-8 without NUL.
#pragma once

#include <string>

#include "absl/strings/string_view.h"

namespace sightline {

bool IsPlainText(absl::string_view text);

// The text with U+FFFD for every byte that is none, cut to `max_bytes` or a little less.
std::string ToPlainText(absl::string_view text, size_t max_bytes);

}  // namespace sightline
