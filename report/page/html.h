// SPDX-License-Identifier: Apache-2.0
// Texts and JSON inside an HTML page, and grouped digits.
#pragma once

#include <cstdint>
#include <string>

#include "absl/strings/string_view.h"

namespace sightline {

// Escapes text for element content and quoted attributes.
std::string EscapeHtml(absl::string_view text);

// "20 134": digits in groups of three, separated by narrow no-break spaces.
std::string GroupedInteger(int64_t value);

// Removes white space between the tokens of a JSON text.
std::string CompactJson(absl::string_view json);

// Makes a JSON text safe inside a script element: "<" becomes "\u003c".
std::string JsonForScript(absl::string_view json);

}  // namespace sightline
