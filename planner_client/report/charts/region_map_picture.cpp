// SPDX-License-Identifier: Apache-2.0
#include "planner_client/report/charts/region_map_picture.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "planner_client/report/charts/chart_axis.h"
#include "planner_client/report/page/html.h"
#include "planner_client/report/page/number_text.h"

namespace sightline {
namespace {

// |z| from which on a deeper colour is used: 1 and 2 are chance, the others are not.
constexpr std::array<double, 6> kLevels = {1, 2, 3, 5, 10, 20};
constexpr int kDeepest = static_cast<int>(kLevels.size());

int Level(double z) {
  int level = 0;
  while (level < kDeepest && std::abs(z) >= kLevels[level]) ++level;
  return z < 0 ? -level : level;
}

std::string LevelClass(int level) {
  return absl::StrCat(level < 0 ? "less" : "more", std::abs(level));
}

std::vector<double> Edges(const std::vector<double>& given, int count) {
  if (!given.empty()) return given;
  std::vector<double> edges;
  for (int i = 0; i <= count; ++i) edges.push_back(i);
  return edges;
}

}  // namespace

std::string RegionMapSvg(const RegionMapGrid& grid, const std::string& title) {
  constexpr double kWidth = 400, kLeft = 46, kRight = 6, kTop = 4, kBottom = 38;
  assert(grid.z.size() == static_cast<size_t>(grid.rows) * static_cast<size_t>(grid.columns));
  const std::vector<double> rows = Edges(grid.row_edges_px, grid.rows);
  const std::vector<double> columns = Edges(grid.column_edges_px, grid.columns);
  const double span_x = columns.back() - columns.front(), span_y = rows.back() - rows.front();
  const double plot_width = kWidth - kLeft - kRight;
  // In the proportions of the image, as long as that can be read.
  const double plot_height = std::clamp(plot_width * span_y / std::max(span_x, 1e-9), 120.0, 420.0);
  const double bottom = kTop + plot_height;
  ChartAxis x_axis, y_axis;
  x_axis.low = columns.front();
  x_axis.high = columns.back();
  y_axis.low = rows.front();
  y_axis.high = rows.back();
  const ChartScale x(x_axis, {}, kLeft, kWidth - kRight), y(y_axis, {}, kTop, bottom);

  std::string svg = absl::StrFormat(
      "<svg class=\"chart map\" viewBox=\"0 0 %.0f %.0f\" role=\"img\" aria-label=\"%s\">\n"
      "<rect class=\"no-data\" x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\"/>\n",
      kWidth, bottom + kBottom, EscapeHtml(title), kLeft, kTop, plot_width, plot_height);
  // One path for every colour; neighbours of one colour in a row are one rectangle.
  std::array<std::string, 2 * kDeepest + 1> paths;
  for (int row = 0; row < grid.rows; ++row) {
    for (int column = 0; column < grid.columns;) {
      const size_t start = static_cast<size_t>(row) * static_cast<size_t>(grid.columns);
      const double z = grid.z[start + static_cast<size_t>(column)];
      int end = column + 1;
      if (!std::isfinite(z)) {
        column = end;
        continue;
      }
      const int level = Level(z);
      while (end < grid.columns && std::isfinite(grid.z[start + static_cast<size_t>(end)]) &&
             Level(grid.z[start + static_cast<size_t>(end)]) == level) {
        ++end;
      }
      absl::StrAppendFormat(&paths[level + kDeepest], "M%.1f %.1fH%.1fV%.1fH%.1fZ",
                            x.At(columns[column]), y.At(rows[row]), x.At(columns[end]),
                            y.At(rows[row + 1]), x.At(columns[column]));
      column = end;
    }
  }
  for (int level = -kDeepest; level <= kDeepest; ++level) {
    const std::string& path = paths[level + kDeepest];
    if (path.empty()) continue;
    absl::StrAppend(&svg, "<path class=\"", LevelClass(level), "\" d=\"", path, "\"/>\n");
  }
  for (const double tick : y.Ticks(std::max(2, static_cast<int>(plot_height / 44)))) {
    absl::StrAppendFormat(
        &svg, "<text class=\"tick\" x=\"%.1f\" y=\"%.1f\" text-anchor=\"end\">%s</text>\n",
        kLeft - 6, y.At(tick) + 4, ShortNumber(tick));
  }
  for (const double tick : x.Ticks(6)) {
    absl::StrAppendFormat(
        &svg, "<text class=\"tick\" x=\"%.1f\" y=\"%.1f\" text-anchor=\"middle\">%s</text>\n",
        x.At(tick), bottom + 15, ShortNumber(tick));
  }
  const bool in_px = !grid.row_edges_px.empty() && !grid.column_edges_px.empty();
  absl::StrAppendFormat(
      &svg,
      "<text class=\"axis\" x=\"%.1f\" y=\"%.1f\" text-anchor=\"middle\">%s</text>"
      "<text class=\"axis\" x=\"11\" y=\"%.1f\" text-anchor=\"middle\" transform=\"rotate(-90 11 "
      "%.1f)\">%s</text>\n",
      0.5 * (kLeft + kWidth - kRight), bottom + 32, in_px ? "column [px]" : "column block",
      0.5 * (kTop + bottom), 0.5 * (kTop + bottom), in_px ? "row [px]" : "row block");
  return svg + "</svg>\n";
}

std::string RegionMapKeySvg() {
  constexpr double kCell = 30, kHeight = 14;
  std::string svg = absl::StrFormat(
      "<svg class=\"map-key\" viewBox=\"0 0 %.0f 34\" role=\"img\" aria-label=\"Colours of the "
      "standardised residual\">\n",
      kCell * (2 * kDeepest + 1));
  for (int level = -kDeepest; level <= kDeepest; ++level) {
    const double left = kCell * (level + kDeepest);
    absl::StrAppendFormat(
        &svg, "<rect class=\"%s\" x=\"%.1f\" y=\"0\" width=\"%.1f\" height=\"%.1f\"/>\n",
        LevelClass(level), left, kCell, kHeight);
    // The value at the border towards 0.
    if (level == 0) continue;
    absl::StrAppendFormat(
        &svg, "<text class=\"tick\" x=\"%.1f\" y=\"29\" text-anchor=\"middle\">%s</text>\n",
        level < 0 ? left + kCell : left,
        ShortNumber(std::copysign(kLevels[std::abs(level) - 1], level)));
  }
  return svg + "</svg>\n";
}

}  // namespace sightline
