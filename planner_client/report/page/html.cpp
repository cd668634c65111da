// SPDX-License-Identifier: Apache-2.0
#include "planner_client/report/page/html.h"

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"

namespace sightline {

std::string EscapeHtml(absl::string_view text) {
  return absl::StrReplaceAll(
      text, {{"&", "&amp;"}, {"<", "&lt;"}, {">", "&gt;"}, {"\"", "&quot;"}, {"'", "&#39;"}});
}

std::string ScrollingTable(absl::string_view label_html, absl::string_view attributes) {
  std::string label;
  bool in_tag = false;
  for (const char c : label_html) {
    if (c == '<') in_tag = true;
    if (!in_tag) label += c;
    if (c == '>' && in_tag) {
      in_tag = false;
      label += ' ';
    }
  }
  return absl::StrCat("<div class=\"table-wrap\" tabindex=\"0\" role=\"group\" aria-label=\"",
                      absl::StrReplaceAll(label, {{"\"", "&quot;"}}), "\"><table",
                      attributes.empty() ? "" : " ", attributes, ">");
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

std::string PngDataUri(absl::string_view png) {
  return absl::StrCat("data:image/png;base64,", absl::Base64Escape(png));
}

std::string JsonForScript(absl::string_view json) {
  return absl::StrReplaceAll(json, {{"<", "\\u003c"}});
}

}  // namespace sightline
