// SPDX-License-Identifier: Apache-2.0
// How wide the reader's window is, and text that fits into it.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace sightline {

// Width of help and of messages about wrong arguments. deploy/command_line reads help of this form,
// so it does not follow the terminal.
inline constexpr size_t kHelpColumns = 80;

// Columns of the terminal behind a file descriptor; `otherwise` if it is none.
size_t TerminalColumns(int fd, size_t otherwise);

// The text with lines broken between words so that none has more than `columns` characters; words
// that are longer stay whole. Lines that fit stay as they are, lines that go on begin with
// `indent`.
std::string WrapText(std::string_view text, size_t columns, std::string_view indent = "");

// Prints to stdout, wrapped if that is a terminal; files and pipes get the text as it is.
void PrintWrapped(std::string_view text);

}  // namespace sightline
