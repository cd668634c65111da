// SPDX-License-Identifier: Apache-2.0
#include "planner_client/command_line/help/terminal.h"

#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <limits>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"

namespace sightline {
namespace {

// In narrower terminals a line would hold hardly one word.
constexpr size_t kLeastColumns = 30;

std::string WrapLine(absl::string_view line, size_t columns, std::string_view indent) {
  std::string wrapped;
  size_t used = 0;
  while (!line.empty()) {
    const size_t space = line.find_first_not_of(' ');
    const size_t end = line.find(' ', space == absl::string_view::npos ? 0 : space);
    const absl::string_view word = line.substr(0, end);  // with the spaces before it
    if (used > 0 && used + word.size() > columns && space != absl::string_view::npos) {
      absl::StrAppend(&wrapped, "\n", absl::string_view(indent.data(), indent.size()),
                      word.substr(space));
      used = indent.size() + word.size() - space;
    } else {
      absl::StrAppend(&wrapped, word);
      used += word.size();
    }
    if (end == absl::string_view::npos) break;
    line.remove_prefix(end);
  }
  return wrapped;
}

}  // namespace

size_t TerminalColumns(int fd, size_t otherwise) {
  winsize size{};
  if (isatty(fd) == 0 || ioctl(fd, TIOCGWINSZ, &size) != 0 || size.ws_col == 0) return otherwise;
  return std::max<size_t>(size.ws_col, kLeastColumns);
}

std::string WrapText(std::string_view text, size_t columns, std::string_view indent) {
  std::vector<std::string> lines;
  for (const absl::string_view line :
       absl::StrSplit(absl::string_view(text.data(), text.size()), '\n')) {
    lines.push_back(line.size() <= columns ? std::string(line) : WrapLine(line, columns, indent));
  }
  return absl::StrJoin(lines, "\n");
}

void PrintWrapped(std::string_view text) {
  const size_t columns = TerminalColumns(STDOUT_FILENO, std::numeric_limits<size_t>::max());
  const std::string wrapped = WrapText(text, columns, "  ");
  std::fwrite(wrapped.data(), 1, wrapped.size(), stdout);
}

}  // namespace sightline
