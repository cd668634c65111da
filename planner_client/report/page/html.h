// SPDX-License-Identifier: Apache-2.0
// Pieces of HTML.
#pragma once

#include <cstdint>
#include <string>

#include "absl/strings/string_view.h"

namespace sightline {

// Safe as text and inside quoted attributes.
std::string EscapeHtml(absl::string_view text);

// Begins a table that scrolls sideways where it is wider than the page, within the keyboard's
// reach: a focusable group around <table ATTRIBUTES>. Both end with "</table></div>". `label_html`
// names the table to screen readers; tags in it are left out.
std::string ScrollingTable(absl::string_view label_html, absl::string_view attributes = "");

// "20 134": digits in groups of three, separated by narrow no-break spaces.
std::string GroupedInteger(int64_t value);

// data: URI of a PNG.
std::string PngDataUri(absl::string_view png);

// JSON text that may stand inside a script element: "<" becomes "\u003c".
std::string JsonForScript(absl::string_view json);

}  // namespace sightline
