// SPDX-License-Identifier: Apache-2.0
// Safe output for people. Names in files come from outside: a terminal would execute their control
// characters, and bidirectional control characters can disguise a name.
//
//   PrintText("%s: %d faces\n", name, count);
//   PrintTextTo(stderr, "warning: %s\n", warning);
#pragma once

#include <cstdio>
#include <string>

#include "absl/strings/str_format.h"
#include "core/text/printable.h"

namespace sightline {

// Writes the text of absl::StrFormat with control characters escaped
// (core/text/printable.h).
template <typename... Args>
void PrintTextTo(FILE* stream, const absl::FormatSpec<Args...>& format, const Args&... args) {
  std::fputs(Printable(absl::StrFormat(format, args...)).c_str(), stream);
}

// Writes the same to standard output.
template <typename... Args>
void PrintText(const absl::FormatSpec<Args...>& format, const Args&... args) {
  PrintTextTo(stdout, format, args...);
}

}  // namespace sightline
