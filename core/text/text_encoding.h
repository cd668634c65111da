// SPDX-License-Identifier: Apache-2.0
// Editors and transfers put bytes around the text of a file: byte order marks in front, NUL and
// Ctrl-Z behind. Readers of text formats take the text between them.
#pragma once

#include <string_view>

#include "absl/status/statusor.h"

namespace sightline {

// The text behind a byte order mark of UTF-8, or all of it. INVALID_ARGUMENT for a text that starts
// with the mark of UTF-16 or UTF-32; the message is the reason alone.
absl::StatusOr<std::string_view> WithoutByteOrderMark(std::string_view text);

// The text without white space, NUL and Ctrl-Z (the end mark of CP/M and DOS) at its end.
std::string_view WithoutEndMarks(std::string_view text);

}  // namespace sightline
