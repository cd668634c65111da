// SPDX-License-Identifier: Apache-2.0
#include "planner_client/report/charts/xy_chart.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "planner_client/report/page/html.h"
#include "planner_client/report/page/number_text.h"

namespace sightline {
namespace {

bool Drawable(const ChartAxis& axis, double value) {
  return std::isfinite(value) && (!axis.logarithmic || value > 0);
}

// Values beside the abscissa's axis are left out; those above or below are drawn at its end.
bool DrawableX(const XyChart& chart, const ChartScale& x, double value) {
  return Drawable(chart.x, value) && x.Shows(value);
}

bool HasBand(const ChartSeries& series) {
  return !series.half_band.empty() || !series.lower.empty();
}

double BandLower(const ChartSeries& series, size_t i) {
  return series.lower.empty() ? series.y[i] - series.half_band[i] : series.lower[i];
}

double BandUpper(const ChartSeries& series, size_t i) {
  return series.lower.empty() ? series.y[i] + series.half_band[i] : series.upper[i];
}

void AppendBand(std::string* svg, const XyChart& chart, const ChartSeries& series,
                const ChartScale& x, const ChartScale& y) {
  std::string upper_path, lower_path;
  const auto flush = [&] {
    if (!upper_path.empty()) {
      absl::StrAppend(svg, "<path class=\"band ", series.css_class, "\" d=\"M",
                      upper_path.substr(1), lower_path, "Z\"/>\n");
    }
    upper_path.clear();
    lower_path.clear();
  };
  for (size_t i = 0; i < series.x.size(); ++i) {
    const double lower = BandLower(series, i), upper = BandUpper(series, i);
    if (!DrawableX(chart, x, series.x[i]) || !std::isfinite(lower) || !std::isfinite(upper)) {
      flush();
      continue;
    }
    // On a logarithmic axis the band may reach below its end.
    const auto at = [&](double value) {
      return y.At(chart.y.logarithmic ? std::max(value, y.low()) : value);
    };
    absl::StrAppendFormat(&upper_path, "L%.1f %.1f", x.At(series.x[i]), at(upper));
    lower_path.insert(0, absl::StrFormat("L%.1f %.1f", x.At(series.x[i]), at(lower)));
  }
  flush();
}

void AppendLine(std::string* svg, const XyChart& chart, const ChartSeries& series,
                const ChartScale& x, const ChartScale& y) {
  std::string path;
  bool gap = true;
  for (size_t i = 0; i < series.x.size(); ++i) {
    if (!DrawableX(chart, x, series.x[i]) || !Drawable(chart.y, series.y[i])) {
      gap = true;
      continue;
    }
    absl::StrAppendFormat(&path, "%c%.1f %.1f", gap ? 'M' : 'L', x.At(series.x[i]),
                          y.At(series.y[i]));
    gap = false;
  }
  if (path.empty()) return;
  absl::StrAppend(svg, "<path class=\"line",
                  series.mark == SeriesMark::kDashedLine ? " dashed " : " ", series.css_class,
                  "\" d=\"", path, "\"/>\n");
}

void AppendDots(std::string* svg, const XyChart& chart, const ChartSeries& series,
                const ChartScale& x, const ChartScale& y) {
  const char* css_class = series.mark == SeriesMark::kHollowDots ? "hollow"
                          : series.mark == SeriesMark::kRings    ? "ring"
                                                                 : "dot";
  // Many dots are small dots.
  const double radius = series.mark == SeriesMark::kRings ? 7 : series.x.size() > 60 ? 1.8 : 3.2;
  for (size_t i = 0; i < series.x.size(); ++i) {
    if (!DrawableX(chart, x, series.x[i]) || !Drawable(chart.y, series.y[i])) continue;
    absl::StrAppendFormat(svg, "<circle class=\"%s %s\" cx=\"%.1f\" cy=\"%.1f\" r=\"%.1f\"",
                          css_class, series.css_class, x.At(series.x[i]), y.At(series.y[i]),
                          radius);
    if (series.notes.empty()) {
      absl::StrAppend(svg, "/>\n");
    } else {
      absl::StrAppend(svg, "><title>", EscapeHtml(series.notes[i]), "</title></circle>\n");
    }
  }
}

// Above its dot, or below where there is a dot or another label.
void AppendLabels(std::string* svg, const XyChart& chart, const ChartSeries& series,
                  const ChartScale& x, const ChartScale& y) {
  constexpr double kCharacter = 7.5, kHalfHeight = 6, kDot = 4, kAway = 14;
  struct Box {
    double x, y, half_width, half_height;
  };
  std::vector<Box> taken;
  const auto drawable = [&](size_t i) {
    return DrawableX(chart, x, series.x[i]) && Drawable(chart.y, series.y[i]);
  };
  for (size_t i = 0; i < series.labels.size(); ++i) {
    if (drawable(i)) taken.push_back({x.At(series.x[i]), y.At(series.y[i]), kDot, kDot});
  }
  for (size_t i = 0; i < series.labels.size(); ++i) {
    if (!drawable(i)) continue;
    for (const double away : {-kAway, kAway}) {
      const Box box{x.At(series.x[i]), y.At(series.y[i]) + away,
                    0.5 * kCharacter * static_cast<double>(series.labels[i].size()), kHalfHeight};
      if (std::any_of(taken.begin(), taken.end(), [&](const Box& other) {
            return std::abs(other.x - box.x) < other.half_width + box.half_width &&
                   std::abs(other.y - box.y) < other.half_height + box.half_height;
          })) {
        continue;
      }
      taken.push_back(box);
      absl::StrAppendFormat(
          svg, "<text class=\"label\" x=\"%.1f\" y=\"%.1f\" text-anchor=\"middle\">%s</text>\n",
          box.x, box.y + 4, EscapeHtml(series.labels[i]));
      break;
    }
  }
}

}  // namespace

std::string XyChartSvg(const XyChart& chart) {
  constexpr double kLeft = 58, kRight = 12, kTitleHeight = 24, kTop = 10, kBottom = 44;
  std::vector<double> xs, ys = chart.marks;
  for (const ChartSeries& series : chart.series) {
    assert(series.x.size() == series.y.size());
    assert(series.half_band.empty() || series.half_band.size() == series.y.size());
    assert(series.lower.empty() || series.lower.size() == series.y.size());
    assert(series.upper.size() == series.lower.size());
    assert(series.labels.empty() || series.labels.size() == series.y.size());
    assert(series.notes.empty() || series.notes.size() == series.y.size());
    xs.insert(xs.end(), series.x.begin(), series.x.end());
    for (size_t i = 0; i < series.y.size(); ++i) {
      if (series.x[i] < chart.x.low.value_or(-INFINITY) ||
          series.x[i] > chart.x.high.value_or(INFINITY)) {
        continue;
      }
      ys.push_back(series.y[i]);
      // A symmetric band may reach to zero and below, where a logarithmic axis has no place.
      if (!HasBand(series) || (chart.y.logarithmic && series.lower.empty())) continue;
      ys.push_back(BandUpper(series, i));
      ys.push_back(BandLower(series, i));
    }
  }
  const double top = kTop + (chart.title.empty() ? 0 : kTitleHeight);
  const double bottom = chart.height - (chart.hide_x_labels ? 8 : kBottom);
  const double right = chart.width - kRight;
  const ChartScale x(chart.x, xs, kLeft, right), y(chart.y, ys, bottom, top);

  std::string svg = absl::StrFormat(
      "<svg class=\"%s\" viewBox=\"0 0 %d %d\" role=\"img\" aria-label=\"%s\">\n",
      chart.width < 800 ? "chart" : "chart wide", chart.width, chart.height,
      EscapeHtml(chart.title.empty() ? absl::StrCat(chart.y.title, " against ", chart.x.title)
                                     : chart.title));
  if (!chart.title.empty()) {
    absl::StrAppendFormat(&svg, "<text class=\"title\" x=\"%.1f\" y=\"16\">%s</text>\n", kLeft,
                          EscapeHtml(chart.title));
  }
  for (const double tick : y.Ticks(std::max(2, static_cast<int>((bottom - top) / 34)))) {
    absl::StrAppendFormat(
        &svg,
        "<line class=\"grid\" x1=\"%.1f\" x2=\"%.1f\" y1=\"%.1f\" y2=\"%.1f\"/>"
        "<text class=\"tick\" x=\"%.1f\" y=\"%.1f\" text-anchor=\"end\">%s</text>\n",
        kLeft, right, y.At(tick), y.At(tick), kLeft - 6, y.At(tick) + 4, ShortNumber(tick));
  }
  for (const double tick : x.Ticks(std::max(2, static_cast<int>((right - kLeft) / 56)))) {
    absl::StrAppendFormat(&svg,
                          "<line class=\"grid\" x1=\"%.1f\" x2=\"%.1f\" y1=\"%.1f\" y2=\"%.1f\"/>",
                          x.At(tick), x.At(tick), bottom, bottom + 4);
    if (!chart.hide_x_labels) {
      absl::StrAppendFormat(
          &svg, "<text class=\"tick\" x=\"%.1f\" y=\"%.1f\" text-anchor=\"middle\">%s</text>",
          x.At(tick), bottom + 17, ShortNumber(tick));
    }
    svg += "\n";
  }
  if (!chart.hide_x_labels) {
    absl::StrAppendFormat(
        &svg, "<text class=\"axis\" x=\"%.1f\" y=\"%d\" text-anchor=\"middle\">%s</text>\n",
        0.5 * (kLeft + right), chart.height - 8, EscapeHtml(chart.x.title));
  }
  absl::StrAppendFormat(&svg,
                        "<text class=\"axis\" x=\"12\" y=\"%.1f\" text-anchor=\"middle\" "
                        "transform=\"rotate(-90 12 %.1f)\">%s</text>\n",
                        0.5 * (top + bottom), 0.5 * (top + bottom), EscapeHtml(chart.y.title));
  for (const double mark : chart.marks) {
    if (!y.Shows(mark)) continue;
    absl::StrAppendFormat(
        &svg, "<line class=\"mark\" x1=\"%.1f\" x2=\"%.1f\" y1=\"%.1f\" y2=\"%.1f\"/>\n", kLeft,
        right, y.At(mark), y.At(mark));
  }
  for (const ChartSeries& series : chart.series) {
    if (HasBand(series)) AppendBand(&svg, chart, series, x, y);
  }
  for (const ChartSeries& series : chart.series) {
    if (series.mark == SeriesMark::kLine || series.mark == SeriesMark::kDashedLine ||
        series.mark == SeriesMark::kLineAndDots) {
      AppendLine(&svg, chart, series, x, y);
    }
    if (series.mark != SeriesMark::kLine && series.mark != SeriesMark::kDashedLine) {
      AppendDots(&svg, chart, series, x, y);
    }
    AppendLabels(&svg, chart, series, x, y);
  }
  return svg + "</svg>\n";
}

}  // namespace sightline
