// SPDX-License-Identifier: Apache-2.0
// Sections, keys and tables of the plan's report as HTML.
#pragma once

#include <string>
#include <vector>

#include "absl/strings/string_view.h"

namespace sightline {

// Empty body: nothing at all.
std::string PageSection(absl::string_view id, absl::string_view title, absl::string_view body_html);

enum class KeyShape { kLine, kDashedLine, kDot, kHollowDot, kRing, kBand, kBox };
struct KeyEntry {
  std::string css_class;  // colour, see charts.css
  KeyShape shape;
  std::string text;
};
// A key to the colours of the charts below.
std::string ChartKey(const std::vector<KeyEntry>& entries);

// Cells are HTML. `words`: columns (counted from 0) of text
// rather than numbers.
std::string PageTable(const std::vector<std::string>& head,
                      const std::vector<std::vector<std::string>>& rows,
                      const std::vector<int>& words);

}  // namespace sightline
