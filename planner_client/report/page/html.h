// SPDX-License-Identifier: Apache-2.0
// Pieces of HTML.
#pragma once

#include <cstdint>
#include <string>

#include "absl/strings/string_view.h"

namespace sightline {

// Safe as text and inside quoted attributes.
std::string EscapeHtml(absl::string_view text);

// A paragraph in the soft colour of remarks.
std::string SoftParagraph(absl::string_view html);

// An identifier, escaped.
std::string CodeHtml(absl::string_view text);

// "20 134": digits in groups of three, separated by narrow no-break spaces.
std::string GroupedInteger(int64_t value);

// data: URI of a PNG.
std::string PngDataUri(absl::string_view png);

// JSON text that may stand inside a script element: "<" becomes "\u003c".
std::string JsonForScript(absl::string_view json);

}  // namespace sightline
