// SPDX-License-Identifier: Apache-2.0
// Width of the terminal, and text wrapped to it.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace sightline {

// Width of help and of messages about wrong arguments. deploy/command_line reads help of this form,
// so it does not follow the terminal.
inline constexpr size_t kHelpColumns = 80;

// Number of columns of the terminal at a file descriptor; `otherwise` if it is no terminal.
size_t TerminalColumns(int fd, size_t otherwise);

// Breaks lines between words so that none has more than `columns` characters. Longer
// words stay whole, fitting lines stay unchanged, and continuation lines begin with
// `indent`.
std::string WrapText(std::string_view text, size_t columns, std::string_view indent = "");

// Prints to stdout. The text is wrapped for a terminal and unchanged for files and pipes.
void PrintWrapped(std::string_view text);

}  // namespace sightline
