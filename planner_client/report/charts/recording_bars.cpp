// SPDX-License-Identifier: Apache-2.0
#include "planner_client/report/charts/recording_bars.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "planner_client/report/charts/chart_axis.h"
#include "planner_client/report/page/html.h"
#include "planner_client/report/page/number_text.h"

namespace sightline {
std::string RecordingBarsSvg(const std::string& value_title,
                             const std::vector<RecordingBars>& recordings) {
  constexpr double kWidth = 900, kHeight = 260, kLeft = 58, kRight = 12, kTop = 10, kBottom = 44;
  // At least from 1/2 to 2: scatter about 1 shall not look like much.
  std::vector<double> values = {0.5, 2};
  for (const RecordingBars& recording : recordings) {
    for (const RecordingBar& bar : recording.bars) values.push_back(bar.value);
  }
  ChartAxis axis;
  axis.logarithmic = true;
  const double bottom = kHeight - kBottom;
  const ChartScale y(axis, values, bottom, kTop);
  const double step = (kWidth - kLeft - kRight) / std::max<double>(1, recordings.size());

  std::string svg = absl::StrFormat(
      "<svg class=\"chart wide\" viewBox=\"0 0 %.0f %.0f\" role=\"img\" aria-label=\"%s of every "
      "recording\">\n",
      kWidth, kHeight, EscapeHtml(value_title));
  for (const double tick : y.Ticks(6)) {
    absl::StrAppendFormat(
        &svg,
        "<line class=\"grid\" x1=\"%.1f\" x2=\"%.1f\" y1=\"%.1f\" y2=\"%.1f\"/>"
        "<text class=\"tick\" x=\"%.1f\" y=\"%.1f\" text-anchor=\"end\">%s</text>\n",
        kLeft, kWidth - kRight, y.At(tick), y.At(tick), kLeft - 6, y.At(tick) + 4,
        ShortNumber(tick));
  }
  // Labels as many as there is room for.
  const auto every = std::max<size_t>(1, static_cast<size_t>(std::ceil(26 / std::max(step, 0.1))));
  for (size_t i = 0; i < recordings.size(); ++i) {
    const RecordingBars& recording = recordings[i];
    const double left = kLeft + step * static_cast<double>(i);
    if (recording.marked) {
      absl::StrAppendFormat(
          &svg, "<rect class=\"usual\" x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\"/>\n",
          left, kTop, step, bottom - kTop);
    }
    if (i % every == 0) {
      absl::StrAppendFormat(
          &svg, "<text class=\"tick\" x=\"%.1f\" y=\"%.1f\" text-anchor=\"middle\">%s</text>\n",
          left + 0.5 * step, bottom + 17, EscapeHtml(recording.label));
    }
    const double width = 0.76 * step / std::max<double>(1, recording.bars.size());
    absl::StrAppend(&svg, "<g>");
    if (!recording.note.empty()) {
      absl::StrAppend(&svg, "<title>", EscapeHtml(recording.note), "</title>");
    }
    for (size_t k = 0; k < recording.bars.size(); ++k) {
      const RecordingBar& bar = recording.bars[k];
      if (!std::isfinite(bar.value) || bar.value <= 0) continue;
      const double from = y.At(1), to = y.At(bar.value);
      absl::StrAppendFormat(
          &svg, "<rect class=\"bar %s\" x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\"/>",
          bar.css_class, left + 0.12 * step + width * static_cast<double>(k), std::min(from, to),
          0.94 * width, std::max(std::abs(from - to), 0.5));
    }
    svg += "</g>\n";
  }
  absl::StrAppendFormat(
      &svg,
      "<line class=\"mark\" x1=\"%.1f\" x2=\"%.1f\" y1=\"%.1f\" y2=\"%.1f\"/>\n"
      "<text class=\"axis\" x=\"%.1f\" y=\"%.0f\" text-anchor=\"middle\">recording</text>"
      "<text class=\"axis\" x=\"12\" y=\"%.1f\" text-anchor=\"middle\" "
      "transform=\"rotate(-90 12 %.1f)\">%s</text>\n",
      kLeft, kWidth - kRight, y.At(1), y.At(1), 0.5 * (kLeft + kWidth - kRight), kHeight - 8,
      0.5 * (kTop + bottom), 0.5 * (kTop + bottom), EscapeHtml(value_title));
  return svg + "</svg>\n";
}

}  // namespace sightline
