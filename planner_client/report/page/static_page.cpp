// SPDX-License-Identifier: Apache-2.0
#include "planner_client/report/page/static_page.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "planner_client/report/page/html.h"

namespace sightline {
namespace {

std::string KeyDrawing(const KeyEntry& entry) {
  switch (entry.shape) {
    case KeyShape::kLine:
      return absl::StrCat("<path class=\"line ", entry.css_class, "\" d=\"M1 6H23\"/>");
    case KeyShape::kDashedLine:
      return absl::StrCat("<path class=\"line dashed ", entry.css_class, "\" d=\"M1 6H23\"/>");
    case KeyShape::kDot:
      return absl::StrCat("<circle class=\"dot ", entry.css_class,
                          "\" cx=\"12\" cy=\"6\" r=\"4\"/>");
    case KeyShape::kHollowDot:
      return absl::StrCat("<circle class=\"hollow ", entry.css_class,
                          "\" cx=\"12\" cy=\"6\" r=\"4\"/>");
    case KeyShape::kRing:
      return absl::StrCat("<circle class=\"ring ", entry.css_class,
                          "\" cx=\"12\" cy=\"6\" r=\"5\"/>");
    case KeyShape::kBand:
      return absl::StrCat("<path class=\"band ", entry.css_class, "\" d=\"M0 1H24V11H0Z\"/>");
    case KeyShape::kBox:
      return absl::StrCat("<rect class=\"", entry.css_class,
                          "\" x=\"5\" y=\"0\" width=\"12\" height=\"12\"/>");
  }
  return "";
}

}  // namespace

std::string PageSection(absl::string_view id, absl::string_view title,
                        absl::string_view body_html) {
  if (body_html.empty()) return "";
  return absl::StrCat("<section id=\"", id, "\" class=\"long\">\n<h2>", EscapeHtml(title),
                      "</h2>\n", body_html, "</section>\n");
}

std::string ChartKey(const std::vector<KeyEntry>& entries) {
  std::string html = "<p class=\"chart-key\">";
  for (const KeyEntry& entry : entries) {
    absl::StrAppend(&html, "<span><svg class=\"chart\" viewBox=\"0 0 24 12\" aria-hidden=\"true\">",
                    KeyDrawing(entry), "</svg> ", EscapeHtml(entry.text), "</span>\n");
  }
  return html + "</p>\n";
}

std::string PageTable(const std::vector<std::string>& head,
                      const std::vector<std::vector<std::string>>& rows,
                      const std::vector<int>& words) {
  const auto css = [&](size_t column) {
    return std::find(words.begin(), words.end(), static_cast<int>(column)) != words.end()
               ? " class=\"words\""
               : "";
  };
  // Readers of the screen hear the first column's name.
  std::string html =
      absl::StrCat(ScrollingTable(head.empty() ? "Table" : head.front()), "\n<thead><tr>");
  for (size_t i = 0; i < head.size(); ++i) {
    // A column without a name has no header cell.
    absl::StrAppend(&html, head[i].empty() ? "<td" : "<th scope=\"col\"", css(i), ">", head[i],
                    head[i].empty() ? "</td>" : "</th>");
  }
  html += "</tr></thead>\n<tbody>\n";
  for (const std::vector<std::string>& row : rows) {
    html += "<tr>";
    for (size_t i = 0; i < row.size(); ++i) {
      absl::StrAppend(&html, "<td", css(i), ">", row[i], "</td>");
    }
    html += "</tr>\n";
  }
  return html + "</tbody></table></div>\n";
}

}  // namespace sightline
