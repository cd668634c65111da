// SPDX-License-Identifier: Apache-2.0
#include "planner_client/report/charts/coverage_curve.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "planner_client/report/page/html.h"

namespace sightline {
int CoverageCurveLastScan(const CoverageCurve& curve) {
  return std::max(
      {static_cast<int>(curve.coverage.size()), static_cast<int>(std::ceil(curve.bound_scans)), 1});
}

std::string CoverageCurveSvg(const CoverageCurve& curve) {
  constexpr double kWidth = 760, kHeight = 340;
  constexpr double kLeft = 52, kRight = 24, kTop = 22, kBottom = 46;
  const int scans = static_cast<int>(curve.coverage.size());
  const int last = CoverageCurveLastScan(curve);
  const double x_max = last + 0.4;
  const auto x = [&](double scan) { return kLeft + (kWidth - kLeft - kRight) * scan / x_max; };
  const auto y = [&](double fraction) {
    return kHeight - kBottom - (kHeight - kTop - kBottom) * fraction;
  };

  std::string svg = absl::StrFormat(
      "<svg class=\"curve\" viewBox=\"0 0 %.0f %.0f\" role=\"img\" "
      "aria-label=\"%s\">\n",
      kWidth, kHeight, EscapeHtml(curve.title));
  for (int percent = 0; percent <= 100; percent += 20) {
    absl::StrAppendFormat(
        &svg,
        "<line class=\"grid\" x1=\"%.1f\" x2=\"%.1f\" y1=\"%.1f\" y2=\"%.1f\"/>"
        "<text class=\"tick\" x=\"%.1f\" y=\"%.1f\" text-anchor=\"end\">%d</text>\n",
        kLeft, kWidth - kRight, y(percent / 100.0), y(percent / 100.0), kLeft - 8,
        y(percent / 100.0) + 4, percent);
  }
  const int step = std::max(1, static_cast<int>(std::ceil(last / 20.0)));
  for (int scan = 0; scan <= last; scan += step) {
    absl::StrAppendFormat(
        &svg, "<text class=\"tick\" x=\"%.1f\" y=\"%.1f\" text-anchor=\"middle\">%d</text>\n",
        x(scan), kHeight - kBottom + 20, scan);
  }
  absl::StrAppendFormat(
      &svg,
      "<text class=\"axis\" x=\"%.1f\" y=\"%.1f\" text-anchor=\"middle\">scans</text>"
      "<text class=\"axis\" x=\"14\" y=\"%.1f\" text-anchor=\"middle\" "
      "transform=\"rotate(-90 14 %.1f)\">%s</text>\n",
      0.5 * (x(0) + x(x_max)), kHeight - 6, y(0.5), y(0.5), EscapeHtml(curve.axis));
  if (curve.goal > 0) {
    absl::StrAppendFormat(&svg,
                          "<line class=\"goal\" x1=\"%.1f\" x2=\"%.1f\" y1=\"%.1f\" y2=\"%.1f\"/>"
                          "<text class=\"goal-label\" x=\"%.1f\" y=\"%.1f\">goal %.4g %%</text>\n",
                          kLeft, kWidth - kRight, y(curve.goal), y(curve.goal), kLeft + 8,
                          y(curve.goal) - 7, 100 * curve.goal);
  }
  if (curve.bound_scans > 0) {
    // The longer side has room for the longest label.
    const bool label_on_left = curve.bound_scans > 0.5 * x_max;
    absl::StrAppendFormat(
        &svg,
        "<line class=\"bound\" x1=\"%.1f\" x2=\"%.1f\" y1=\"%.1f\" y2=\"%.1f\"/>"
        "<text class=\"bound-label\" x=\"%.1f\" y=\"%.1f\" text-anchor=\"%s\">%s %.1f</text>\n",
        x(curve.bound_scans), x(curve.bound_scans), y(0), y(1),
        x(curve.bound_scans) + (label_on_left ? -8 : 8), y(0) - 10, label_on_left ? "end" : "start",
        curve.bound_converged ? "lower bound" : "relaxation, not a proven bound:",
        curve.bound_scans);
  }
  const bool two = !curve.upper.empty();
  if (two && scans > 0) {
    std::string line = absl::StrFormat("M%.1f %.1f", x(0), y(0));
    for (int i = 0; i < scans; ++i)
      absl::StrAppendFormat(&line, "L%.1f %.1f", x(i + 1), y(curve.upper[i]));
    absl::StrAppendFormat(&svg, "<path class=\"line upper\" d=\"%s\"/>\n", line);
    for (int i = 0; i < scans; ++i) {
      absl::StrAppendFormat(&svg,
                            "<circle class=\"upper-dot\" cx=\"%.1f\" cy=\"%.1f\" r=\"3.5\">"
                            "<title>after scan %d: %.2f %% %s</title></circle>\n",
                            x(i + 1), y(curve.upper[i]), i + 1, 100 * curve.upper[i],
                            EscapeHtml(curve.upper_name));
    }
    // Names at the last points, apart from each other.
    const double last_y = y(curve.coverage.back());
    const double upper_y = std::min(y(curve.upper.back()) - 10, last_y - 30);
    absl::StrAppendFormat(
        &svg, "<text class=\"value\" x=\"%.1f\" y=\"%.1f\" text-anchor=\"end\">%s %.1f</text>\n",
        x(scans) + 10, std::max(kTop - 6, upper_y), EscapeHtml(curve.upper_name),
        100 * curve.upper.back());
  }
  if (curve.fresh.has_value() && scans > 0) {
    absl::StrAppendFormat(
        &svg,
        "<path class=\"fresh\" d=\"M%.1f %.1fl6 6l-6 6l-6 -6Z\">"
        "<title>on targets that the search has not seen: %.2f %%</title></path>\n",
        x(scans) + 15, y(*curve.fresh) - 6, 100 * *curve.fresh);
  }
  if (scans > 0) {
    std::string line = absl::StrFormat("M%.1f %.1f", x(0), y(0));
    for (int i = 0; i < scans; ++i)
      absl::StrAppendFormat(&line, "L%.1f %.1f", x(i + 1), y(curve.coverage[i]));
    absl::StrAppendFormat(
        &svg, "<path class=\"area\" d=\"%sL%.1f %.1fZ\"/><path class=\"line\" d=\"%s\"/>\n", line,
        x(scans), y(0), line);
    double labelled_x = -1e9;
    for (int i = 0; i < scans; ++i) {
      const double before = i > 0 ? curve.coverage[i - 1] : 0;
      absl::StrAppendFormat(
          &svg,
          "<circle class=\"dot\" data-scan=\"%d\" cx=\"%.1f\" cy=\"%.1f\" r=\"5\">"
          "<title>after scan %d: %.2f %% (+%.2f)</title></circle>\n",
          i + 1, x(i + 1), y(curve.coverage[i]), i + 1, 100 * curve.coverage[i],
          100 * (curve.coverage[i] - before));
      // Under the line, where there is room; the last one always.
      const bool is_last = i + 1 == scans;
      if (is_last || (x(i + 1) - labelled_x > 44 && x(scans) - x(i + 1) > (two ? 130 : 44))) {
        absl::StrAppendFormat(
            &svg, "<text class=\"value\" x=\"%.1f\" y=\"%.1f\" text-anchor=\"%s\">%s%.1f</text>\n",
            x(i + 1) + 10, y(curve.coverage[i]) + 22, two && is_last ? "end" : "middle",
            two && is_last ? EscapeHtml(curve.coverage_name) + " " : "", 100 * curve.coverage[i]);
        labelled_x = x(i + 1);
      }
    }
  }
  return svg + "</svg>\n";
}

}  // namespace sightline
