// SPDX-License-Identifier: Apache-2.0
// Frame of the reports that are read, not played with: the look of the plan's report, no script.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "absl/strings/string_view.h"

namespace sightline {

struct StaticPage {
  std::string title;                                         // text
  std::string kicker;                                        // text; what kind of report
  std::string heading;                                       // text
  std::string finding_html;                                  // below it
  std::vector<std::pair<std::string, std::string>> figures;  // name (text), value (HTML)
  std::vector<std::string> warnings;                         // texts
  std::string sections_html;
};

// The whole page as UTF-8 HTML; it loads nothing from anywhere.
std::string StaticPageHtml(const StaticPage& page);

// Empty body: nothing at all.
std::string PageSection(absl::string_view id, absl::string_view title, absl::string_view body_html);

enum class KeyShape { kLine, kDashedLine, kDot, kHollowDot, kRing, kBand, kBox };
struct KeyEntry {
  std::string css_class;  // colour, see charts.css
  KeyShape shape;
  std::string text;
};
// What the colours of the charts below mean.
std::string ChartKey(const std::vector<KeyEntry>& entries);

// Cells are HTML. `words`: columns (counted from 0) of text
// rather than numbers.
std::string PageTable(const std::vector<std::string>& head,
                      const std::vector<std::vector<std::string>>& rows,
                      const std::vector<int>& words);

}  // namespace sightline
