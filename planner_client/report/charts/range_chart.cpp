// SPDX-License-Identifier: Apache-2.0
#include "planner_client/report/charts/range_chart.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "planner_client/report/page/html.h"
#include "planner_client/report/page/number_text.h"

namespace sightline {
std::string RangeChartSvg(const RangeChart& chart) {
  constexpr double kWidth = 900, kLeft = 190, kRight = 660, kRowHeight = 26, kTop = 6, kBottom = 44;
  std::vector<double> values = chart.lines;
  for (const RangeRow& row : chart.rows) {
    for (const RangeMark& mark : row.marks) {
      if (!std::isfinite(mark.value)) continue;
      values.push_back(mark.value);
      values.push_back(mark.value - mark.half_interval);
      values.push_back(mark.value + mark.half_interval);
    }
  }
  if (chart.shaded_high > chart.shaded_low) {
    values.push_back(chart.shaded_low);
    values.push_back(chart.shaded_high);
  }
  const ChartScale x(chart.x, values, kLeft, kRight);
  const double bottom = kTop + kRowHeight * static_cast<double>(chart.rows.size());

  std::string svg = absl::StrFormat(
      "<svg class=\"chart wide\" viewBox=\"0 0 %.0f %.0f\" role=\"img\" aria-label=\"%s\">\n",
      kWidth, bottom + kBottom, EscapeHtml(chart.title));
  if (chart.shaded_high > chart.shaded_low) {
    absl::StrAppendFormat(
        &svg, "<rect class=\"usual\" x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\"/>\n",
        x.At(chart.shaded_low), kTop, x.At(chart.shaded_high) - x.At(chart.shaded_low),
        bottom - kTop);
  }
  for (const double tick : x.Ticks(9)) {
    absl::StrAppendFormat(
        &svg,
        "<line class=\"grid\" x1=\"%.1f\" x2=\"%.1f\" y1=\"%.1f\" y2=\"%.1f\"/>"
        "<text class=\"tick\" x=\"%.1f\" y=\"%.1f\" text-anchor=\"middle\">%s</text>\n",
        x.At(tick), x.At(tick), kTop, bottom, x.At(tick), bottom + 16, ShortNumber(tick));
  }
  for (const double line : chart.lines) {
    if (!x.Shows(line)) continue;
    absl::StrAppendFormat(
        &svg, "<line class=\"mark\" x1=\"%.1f\" x2=\"%.1f\" y1=\"%.1f\" y2=\"%.1f\"/>\n",
        x.At(line), x.At(line), kTop, bottom);
  }
  for (size_t i = 0; i < chart.rows.size(); ++i) {
    const RangeRow& row = chart.rows[i];
    const double middle = kTop + kRowHeight * (static_cast<double>(i) + 0.5);
    absl::StrAppendFormat(
        &svg,
        "<text class=\"label\" x=\"%.1f\" y=\"%.1f\" text-anchor=\"end\">%s</text>"
        "<text class=\"note\" x=\"%.1f\" y=\"%.1f\">%s</text>\n",
        kLeft - 12, middle + 4, EscapeHtml(row.label), kRight + 14, middle + 4,
        EscapeHtml(row.note));
    if (chart.joined && row.marks.size() > 1 && std::isfinite(row.marks.front().value) &&
        std::isfinite(row.marks.back().value)) {
      absl::StrAppendFormat(
          &svg, "<line class=\"joint\" x1=\"%.1f\" x2=\"%.1f\" y1=\"%.1f\" y2=\"%.1f\"/>\n",
          x.At(row.marks.front().value), x.At(row.marks.back().value), middle, middle);
    }
    const auto count = static_cast<double>(row.marks.size());
    for (size_t k = 0; k < row.marks.size(); ++k) {
      const RangeMark& mark = row.marks[k];
      if (!std::isfinite(mark.value)) continue;
      const double y =
          chart.joined ? middle : middle + 8 * (static_cast<double>(k) - 0.5 * (count - 1));
      if (mark.half_interval > 0 && std::isfinite(mark.half_interval)) {
        absl::StrAppendFormat(
            &svg, "<line class=\"interval %s\" x1=\"%.1f\" x2=\"%.1f\" y1=\"%.1f\" y2=\"%.1f\"/>",
            mark.css_class, x.At(mark.value - mark.half_interval),
            x.At(mark.value + mark.half_interval), y, y);
      }
      absl::StrAppendFormat(&svg, "<circle class=\"dot %s\" cx=\"%.1f\" cy=\"%.1f\" r=\"3.8\"/>\n",
                            mark.css_class, x.At(mark.value), y);
    }
  }
  absl::StrAppendFormat(
      &svg, "<text class=\"axis\" x=\"%.1f\" y=\"%.1f\" text-anchor=\"middle\">%s</text>\n",
      0.5 * (kLeft + kRight), bottom + 36, EscapeHtml(chart.x.title));
  return svg + "</svg>\n";
}

}  // namespace sightline
