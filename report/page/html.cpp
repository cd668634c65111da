// SPDX-License-Identifier: Apache-2.0
#include "report/page/html.h"

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"

namespace sightline {

std::string EscapeHtml(absl::string_view text) {
  return absl::StrReplaceAll(
      text, {{"&", "&amp;"}, {"<", "&lt;"}, {">", "&gt;"}, {"\"", "&quot;"}, {"'", "&#39;"}});
}

std::string GroupedInteger(int64_t value) {
  if (value < 0) return absl::StrCat("\u2212", GroupedInteger(-value));
  std::string digits = absl::StrCat(value);
  for (size_t i = digits.size(); i > 3;) {
    i -= 3;
    digits.insert(i, "\u202f");
  }
  return digits;
}

std::string CompactJson(absl::string_view json) {
  std::string compact;
  compact.reserve(json.size());
  bool in_text = false;
  for (size_t i = 0; i < json.size(); ++i) {
    const char c = json[i];
    if (in_text && c == '\\') {
      compact += json[i];
      if (i + 1 < json.size()) compact += json[i + 1];
      ++i;
      continue;
    }
    if (c == '"') in_text = !in_text;
    if (in_text || (c != ' ' && c != '\n')) compact += c;
  }
  return compact;
}

std::string JsonForScript(absl::string_view json) {
  return absl::StrReplaceAll(json, {{"<", "\\u003c"}});
}

}  // namespace sightline
