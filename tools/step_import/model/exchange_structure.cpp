// SPDX-License-Identifier: Apache-2.0
#include "tools/step_import/model/exchange_structure.h"

#include <algorithm>
#include <cstdio>
#include <fstream>
#include <utility>
#include <vector>

#include "tools/step_import/step_input_error.h"

namespace sightline {
namespace {

constexpr std::string_view kBeginMark = "ISO-10303-21;";
constexpr std::string_view kEndMark = "END-ISO-10303-21;";
constexpr size_t kBeginWithin_bytes = 4096;
constexpr size_t kMostBytes = size_t{1} << 31;

[[noreturn]] void TooLarge(const std::string& name) {
  throw StepInputError(name + ": larger than 2 GiB");
}

// Position of the end mark outside of strings and comments; npos if there is none.
size_t FindEndMark(std::string_view text) {
  for (size_t at = 0; at < text.size();) {
    if (text[at] == '\'' || text[at] == '"') {
      // A doubled quote closes a string and opens the next one.
      const size_t close = text.find(text[at], at + 1);
      if (close == std::string_view::npos) return close;
      at = close + 1;
    } else if (text.substr(at, 2) == "/*") {
      const size_t close = text.find("*/", at + 2);
      if (close == std::string_view::npos) return close;
      at = close + 2;
    } else if (text[at] == 'E' && text.substr(at, kEndMark.size()) == kEndMark) {
      return at;
    } else {
      ++at;
    }
  }
  return std::string_view::npos;
}

bool IsBlank(char c) { return c == ' ' || (c >= '\t' && c <= '\r') || c == '\0' || c == '\x1a'; }

void RequireNothingBehind(const std::string& name, std::string_view rest) {
  const auto first = std::ranges::find_if_not(rest, IsBlank);
  const size_t skipped = static_cast<size_t>(first - rest.begin());
  if (skipped == rest.size() || rest.substr(skipped).starts_with("SIGNATURE")) return;
  throw StepInputError(name + ": " + std::to_string(rest.size() - skipped) +
                       " bytes stand behind its end mark \"" + std::string(kEndMark) +
                       "\"; save each exchange structure in a file of its own");
}

}  // namespace

StepText CheckedStepText(std::string name, std::string bytes) {
  if (bytes.size() > kMostBytes) TooLarge(name);
  if (bytes.starts_with("\xEF\xBB\xBF")) bytes.erase(0, 3);
  const size_t begin = std::string_view(bytes).substr(0, kBeginWithin_bytes).find(kBeginMark);
  if (begin == std::string::npos) {
    throw StepInputError(name + ": not a STEP file (it does not begin with " +
                         std::string(kBeginMark) + ")");
  }
  size_t end = FindEndMark(std::string_view(bytes).substr(begin));
  if (end != std::string::npos) {
    end += begin;
  } else {
    // A single quote inside a name hides the mark; the parser says what is wrong there.
    end = bytes.rfind(kEndMark);
  }
  if (end == std::string::npos) {
    throw StepInputError(name + ": truncated (" + std::string(kEndMark) +
                         " is missing at the end)");
  }
  end += kEndMark.size();
  RequireNothingBehind(name, std::string_view(bytes).substr(end));
  bytes.resize(end);
  bytes.push_back('\n');
  return {std::move(name), std::move(bytes)};
}

StepText ReadStepText(const std::filesystem::path& file) {
  const std::string name = file.string();
  std::error_code error;
  if (!std::filesystem::is_regular_file(file, error)) throw StepInputError(name + ": no such file");
  std::ifstream in(file, std::ios::binary);
  if (!in) throw StepInputError(name + ": cannot be opened for reading");
  in.seekg(0, std::ios::end);
  const std::streamoff size = in.tellg();
  if (size < 0) throw StepInputError(name + ": cannot be read");
  if (static_cast<size_t>(size) > kMostBytes) TooLarge(name);
  std::string bytes(static_cast<size_t>(size), '\0');
  in.seekg(0);
  in.read(bytes.data(), size);
  if (!in) throw StepInputError(name + ": cannot be read");
  return CheckedStepText(name, std::move(bytes));
}

StepText ReadStepTextFromInput(const std::string& name) {
  std::string bytes;
  std::vector<char> buffer(size_t{1} << 20);
  while (const size_t got = std::fread(buffer.data(), 1, buffer.size(), stdin)) {
    bytes.append(buffer.data(), got);
    if (bytes.size() > kMostBytes) TooLarge(name);
  }
  if (std::ferror(stdin) != 0) throw StepInputError(name + ": cannot be read");
  return CheckedStepText(name, std::move(bytes));
}

}  // namespace sightline
