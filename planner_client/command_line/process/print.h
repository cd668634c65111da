// SPDX-License-Identifier: Apache-2.0
// How commands write for people. Names in files come from outside: a terminal would obey their
// control characters, and characters of writing direction make a name look like another one.
//
//   PrintText("%s: %d faces\n", name, count);
//   PrintTextTo(stderr, "warning: %s\n", warning);
#pragma once

#include <cstdio>
#include <string>

#include "absl/strings/str_format.h"
#include "core/text/printable.h"

namespace sightline {

// Writes the text that absl::StrFormat makes, with control characters as escapes
// (core/text/printable.h).
template <typename... Args>
void PrintTextTo(FILE* stream, const absl::FormatSpec<Args...>& format, const Args&... args) {
  std::fputs(Printable(absl::StrFormat(format, args...)).c_str(), stream);
}

// The same to standard output.
template <typename... Args>
void PrintText(const absl::FormatSpec<Args...>& format, const Args&... args) {
  PrintTextTo(stdout, format, args...);
}

}  // namespace sightline
