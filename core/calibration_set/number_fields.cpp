// SPDX-License-Identifier: Apache-2.0
#include "core/calibration_set/number_fields.h"

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "core/text/number.h"

namespace sightline {
namespace {

constexpr size_t kMostNumbers = 10000;

absl::StatusOr<std::vector<double>> SeparatedNumbers(std::string text, const std::string& where) {
  for (char& c : text) {
    if (absl::StrContains("[](),", c)) c = ' ';
  }
  std::vector<double> numbers;
  for (const absl::string_view word :
       absl::StrSplit(text, absl::ByAnyChar(" \t\r\n"), absl::SkipEmpty())) {
    if (word == "-") continue;
    const auto number = ParseReal(std::string(word));
    if (!number.ok()) {
      return absl::InvalidArgumentError(absl::StrCat(where, ": ", number.status().message()));
    }
    numbers.push_back(*number);
    if (numbers.size() > kMostNumbers) {
      return absl::InvalidArgumentError(absl::StrCat(where, ": more than 10000 numbers"));
    }
  }
  if (numbers.empty()) return absl::InvalidArgumentError(absl::StrCat(where, ": has no numbers"));
  return numbers;
}

struct KeyLine {
  size_t indent = 0;
  std::string key;
  std::string rest;
};

// A line "  key: rest"; an empty key otherwise.
KeyLine ReadKey(std::string_view line) {
  KeyLine result;
  const size_t begin = line.find_first_not_of(" \t\"");
  const size_t colon = line.find(':');
  if (begin == std::string_view::npos || colon == std::string_view::npos) return result;
  std::string key(line.substr(begin, colon - begin));
  while (!key.empty() && (key.back() == '"' || key.back() == ' ')) key.pop_back();
  for (const char c : key) {
    if (!absl::ascii_isalnum(static_cast<unsigned char>(c)) && c != '_') return result;
  }
  result.indent = begin;
  result.key = std::move(key);
  result.rest = std::string(line.substr(colon + 1));
  return result;
}

}  // namespace

absl::StatusOr<std::vector<double>> NumbersOfField(std::string_view text, const std::string& field,
                                                   const std::string& file) {
  const std::string where = absl::StrCat(file, ": ", field);
  const std::vector<std::string> names = absl::StrSplit(field, '.');
  const std::vector<std::string> lines = absl::StrSplit(std::string(text), absl::ByAnyChar("\n"));
  size_t at = 0, depth = 0, indent = 0;
  std::string found;
  bool inside = false;
  for (; at < lines.size(); ++at) {
    const KeyLine line = ReadKey(lines[at]);
    if (inside) {
      if (!line.key.empty() && line.indent <= indent) break;
      absl::StrAppend(&found, " ", lines[at]);
      continue;
    }
    if (line.key != names[depth] || (depth > 0 && line.indent <= indent)) continue;
    indent = line.indent;
    if (++depth < names.size()) continue;
    inside = true;
    found = line.rest;
  }
  if (!inside) return absl::InvalidArgumentError(absl::StrCat(where, ": there is no such field"));
  return SeparatedNumbers(std::move(found), where);
}

absl::StatusOr<std::vector<double>> NumbersOfTuple(std::string_view text, const std::string& file) {
  return SeparatedNumbers(std::string(text), file);
}

}  // namespace sightline
