// SPDX-License-Identifier: Apache-2.0
// Makes external text safe in messages for people.
#pragma once

#include <string>
#include <string_view>

namespace sightline {

// The text with control characters (C0 but line feed and tab, DEL, C1) as escapes like \x1b, since
// a terminal would obey them, and those of writing direction (Unicode's Bidi_Control) as escapes
// like \u202e, since a name could look like another one. Other characters, also beyond ASCII, stay.
std::string Printable(std::string_view text);

}  // namespace sightline
