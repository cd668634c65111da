// SPDX-License-Identifier: Apache-2.0
#include "planner_client/report/plan/sections/as_measured_section.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "planner_client/report/page/html.h"
#include "planner_client/report/page/number_text.h"
#include "planner_client/report/plan/sections/plan_text.h"

namespace sightline {
namespace {

// Inside to outside; the middle one is "as the model".
constexpr std::array<const char*, 7> kColours = {"#0b386b", "#1d5d9f", "#7fb0dc", "#c9ced3",
                                                 "#f09a5e", "#d9541e", "#752703"};

// "0.123 ± 0.004", two digits of the uncertainty.
std::string WithUncertainty(double value, double uncertainty) {
  if (!(uncertainty > 0)) return Number(value);
  const int decimals = std::clamp(1 - static_cast<int>(std::floor(std::log10(uncertainty))), 0, 7);
  return absl::StrCat(FixedNumber(value, decimals), " \u00b1 ", FixedNumber(uncertainty, decimals));
}

std::string PoseTable(const v1::AsMeasured& found) {
  const auto row = [](absl::string_view name, const v1::Vector3& value,
                      const v1::Vector3& deviation, double scale) {
    std::string html = absl::StrCat("<tr><th scope=\"row\">", name, "</th>");
    for (const auto& [v, s] :
         {std::pair{value.x(), deviation.x()}, std::pair{value.y(), deviation.y()},
          std::pair{value.z(), deviation.z()}}) {
      absl::StrAppend(&html, "<td>", WithUncertainty(scale * v, 2 * scale * s), "</td>");
    }
    return html + "</tr>\n";
  };
  return absl::StrCat(
      ScrollingTable("Pose of the part as it was found", "class=\"facts\""),
      "\n<thead><tr><td></td><th scope=\"col\">x</th><th scope=\"col\">y</th>"
      "<th scope=\"col\">z</th></tr></thead>\n<tbody>\n",
      row("shift, mm (\u00b1 2\u03c3)", found.translation_m(),
          found.translation_standard_deviation_m(), 1e3),
      row("turn, \u00b0 (\u00b1 2\u03c3)", found.rotation_deg(),
          found.rotation_standard_deviation_deg(), 1),
      "</tbody></table></div>\n<p class=\"soft\">Shift of the centre of the model's bounding box, "
      "turn about it. The points lie ",
      QuantityText("x_m", found.residual_standard_deviation_m()),
      " (robust standard deviation) from the model there. Errors that all points of a scan share "
      "are "
      "not in the uncertainty of the pose.</p>\n");
}

std::string Unfixed(const v1::AsMeasured& found) {
  if (found.not_fixed_size() == 0) {
    return "<p>The points fix all six degrees of freedom.</p>\n";
  }
  std::string html = absl::StrFormat(
      "<p><strong>The points do not fix %d of the six degrees of freedom</strong>; there the prior "
      "stays: %s along and %s\u202f\u00b0 about each axis (standard deviations).</p>\n<ul>",
      found.not_fixed_size(), QuantityText("x_m", found.prior_translation_standard_deviation_m()),
      Number(found.prior_rotation_standard_deviation_deg()));
  for (const v1::PoseMovement& m : found.not_fixed()) {
    absl::StrAppendFormat(
        &html,
        "<li>turn (%s, %s, %s)\u202f\u00b0 with shift (%s, %s, %s)\u202fmm: known to %s of the "
        "prior</li>",
        FixedNumber(m.rotation_deg().x(), 2), FixedNumber(m.rotation_deg().y(), 2),
        FixedNumber(m.rotation_deg().z(), 2), FixedNumber(1e3 * m.translation_m().x(), 2),
        FixedNumber(1e3 * m.translation_m().y(), 2), FixedNumber(1e3 * m.translation_m().z(), 2),
        Percent(m.standard_deviation_relative(), 2));
  }
  return html + "</ul>\n";
}

std::string ScansTable(const v1::AsMeasured& found) {
  std::string html =
      absl::StrCat(ScrollingTable("Measured scans", "class=\"facts\""),
                   "\n<thead><tr><th scope=\"col\">measured "
                   "scan</th><th scope=\"col\">file</th><th scope=\"col\">points</th><th "
                   "scope=\"col\">median distance<br>mm</th><th scope=\"col\">three quarters "
                   "within<br>mm</th><th scope=\"col\">targets by points</th><th scope=\"col\">by "
                   "simulation</th></tr></thead>\n<tbody>\n");
  for (const v1::MeasuredScan& scan : found.scans()) {
    absl::StrAppend(
        &html, "<tr><th scope=\"row\">", scan.scan(),
        scan.scan() == scan.earlier_scan()
            ? ""
            : absl::StrCat(" <span class=\"soft\">(was ", scan.earlier_scan(), ")</span>"),
        "</th><td>", EscapeHtml(scan.file()), "</td><td>", GroupedInteger(scan.points()),
        "</td><td>", FixedNumber(1e3 * scan.median_distance_m(), 3), "</td><td>",
        FixedNumber(1e3 * scan.upper_quartile_distance_m(), 3), "</td><td>",
        GroupedInteger(scan.covered_targets()), "</td><td>",
        GroupedInteger(scan.simulated_covered_targets()), "</td></tr>\n");
  }
  return html + "</tbody></table></div>\n";
}

std::string ChangeTable(const v1::AsMeasured& found, int scans, bool for_uncertainty) {
  const auto row = [](absl::string_view name, int count, double settled) {
    return absl::StrCat("<tr><th scope=\"row\">", name, "</th><td>", count, "</td><td>",
                        Percent(settled, 2), "</td></tr>\n");
  };
  return absl::StrCat(
      ScrollingTable("Plans on the part as it was found", "class=\"facts\""),
      "\n<thead><tr><th scope=\"col\">on the part as it was "
      "found</th><th scope=\"col\">scans</th><th scope=\"col\">",
      for_uncertainty ? "known admissibly" : "measured", "</th></tr></thead>\n<tbody>\n",
      row("measured scans, by their points", found.scans_size(), found.measured_settled()),
      row("earlier plan", found.earlier_scans(), found.earlier_settled()),
      row("this plan", scans, found.settled()), "</tbody></table></div>\n");
}

// Step of the colours: the largest deviation falls into the last.
double ColourStep(std::span<const ReportDeviation> deviations) {
  double largest_m = 0;
  for (const ReportDeviation& d : deviations) {
    if (d.significant) largest_m = std::max<double>(largest_m, std::abs(d.deviation_m));
  }
  return std::max(largest_m / 3.5, 1e-7);
}

size_t ColourOf(const ReportDeviation& d, double step_m) {
  if (!d.significant) return kColours.size() / 2;
  const auto bin = static_cast<int>(std::lround(d.deviation_m / step_m));
  return static_cast<size_t>(std::clamp(bin, -3, 3) + 3);
}

std::string Histogram(std::span<const ReportDeviation> deviations, double step_m) {
  constexpr int kBins = 41, kWidth = 520, kHeight = 200, kLeft = 10, kBase = 170;
  const double range_m = 3.5 * step_m, bin_m = 2 * range_m / kBins;
  std::array<int, kBins> counts{}, significant{};
  for (const ReportDeviation& d : deviations) {
    const int bin =
        std::clamp(static_cast<int>(std::floor((d.deviation_m + range_m) / bin_m)), 0, kBins - 1);
    ++counts[static_cast<size_t>(bin)];
    significant[static_cast<size_t>(bin)] += d.significant;
  }
  const int most = std::max(1, *std::max_element(counts.begin(), counts.end()));
  std::string svg = absl::StrFormat(
      "<svg viewBox=\"0 0 %d %d\" role=\"img\" aria-label=\"Histogram of deviations\" "
      "style=\"width:100%%;max-width:%dpx\">",
      kWidth, kHeight, kWidth);
  const double bar = (kWidth - 2.0 * kLeft) / kBins;
  // Logarithmic: a bump is a few targets among thousands.
  const auto height = [&](int count) {
    return count == 0 ? 0.0 : 8 + 142 * std::log1p(count) / std::log1p(most);
  };
  for (int b = 0; b < kBins; ++b) {
    const auto at = static_cast<size_t>(b);
    const double x = kLeft + b * bar;
    absl::StrAppendFormat(&svg,
                          "<rect x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\" "
                          "fill=\"#c9ced3\"><title>%d targets</title></rect>",
                          x, kBase - height(counts[at]), bar - 1, height(counts[at]), counts[at]);
    if (significant[at] == 0) continue;
    absl::StrAppendFormat(&svg,
                          "<rect x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\" "
                          "fill=\"#d9541e\"><title>%d significant</title></rect>",
                          x, kBase - height(significant[at]), bar - 1, height(significant[at]),
                          significant[at]);
  }
  for (const double at : {-1.0, 0.0, 1.0}) {
    absl::StrAppendFormat(&svg,
                          "<text x=\"%.1f\" y=\"190\" text-anchor=\"%s\" font-size=\"12\" "
                          "fill=\"currentColor\">%s</text>",
                          kLeft + (at + 1) / 2 * (kWidth - 2 * kLeft),
                          at < 0   ? "start"
                          : at > 0 ? "end"
                                   : "middle",
                          at == 0 ? "0" : QuantityText("x_m", at * range_m));
  }
  return svg + "</svg>";
}

// Targets that face one way, seen along the axis in which the part is thinnest.
std::string Map(std::span<const ReportDeviation> deviations, double step_m, int axis, int side,
                const std::string& title) {
  const int across = (axis + 1) % 3, up = (axis + 2) % 3;
  Eigen::AlignedBox3f box;
  for (const ReportDeviation& d : deviations) box.extend(d.position_m);
  constexpr double kWidth = 520;
  const double scale = kWidth / std::max<double>(box.sizes()[across], 1e-6);
  const double height = std::clamp(scale * box.sizes()[up], 20.0, 900.0);
  std::array<std::string, kColours.size()> paths;
  for (const ReportDeviation& d : deviations) {
    if (side * d.normal[axis] < 0) continue;
    const double from_left = scale * (d.position_m[across] - box.min()[across]);
    absl::StrAppendFormat(&paths[ColourOf(d, step_m)], "M%.0f %.0fh4v4h-4z",
                          side > 0 ? from_left : kWidth - from_left,
                          height - scale * (d.position_m[up] - box.min()[up]));
  }
  std::string svg = absl::StrFormat(
      "<figure><svg viewBox=\"-4 -4 %.0f %.0f\" role=\"img\" aria-label=\"%s\" "
      "style=\"width:100%%;max-width:520px\">",
      kWidth + 12, height + 12, title);
  // The unremarkable ones first, so that they hide nothing.
  for (const size_t colour : {3, 2, 4, 1, 5, 0, 6}) {
    if (paths[colour].empty()) continue;
    absl::StrAppend(&svg, "<path fill=\"", kColours[colour], "\" d=\"", paths[colour], "\"/>");
  }
  return absl::StrCat(svg, "</svg><figcaption>", title, "</figcaption></figure>\n");
}

std::string ColourKey(double step_m) {
  std::string html = "<p class=\"soft\">";
  for (size_t c = 0; c < kColours.size(); ++c) {
    absl::StrAppend(&html, "<span style=\"background:", kColours[c],
                    ";display:inline-block;width:12px;height:12px;margin:0 4px 0 10px\"></span>",
                    c == 3 ? "not significant, or nearly as the model"
                           : QuantityText("x_m", (static_cast<double>(c) - 3) * step_m, 2));
  }
  return html + "</p>\n";
}

std::string DeviationHtml(const v1::SurfaceDeviation& found,
                          std::span<const ReportDeviation> deviations) {
  std::string html = absl::StrCat(
      "<h3>Deviation from the CAD model</h3>\n<p>The points tell of ",
      GroupedInteger(found.known_targets()), " targets; the surface deviates significantly (",
      FixedNumber(found.significance_level(), 1), " standard uncertainties or more) at ",
      GroupedInteger(found.significant_targets()), " of them");
  if (found.significant_targets() > 0) {
    const v1::Vector3& place = found.largest_place_m();
    absl::StrAppend(
        &html, ", by ", QuantityText("x_m", found.root_mean_square_m()),
        " root mean square and <strong>at most by ",
        WithUncertainty(1e3 * found.largest_m(), 2e3 * found.largest_uncertainty_m()),
        " mm</strong> (\u00b1 2u, positive outside) at x, y, z = ", FixedNumber(1e3 * place.x(), 1),
        ", ", FixedNumber(1e3 * place.y(), 1), ", ", FixedNumber(1e3 * place.z(), 1), " mm");
  }
  html += ".</p>\n";
  if (deviations.empty()) return html;
  const double step_m = ColourStep(deviations);
  Eigen::AlignedBox3f box;
  for (const ReportDeviation& d : deviations) box.extend(d.position_m);
  int axis = 0;
  box.sizes().minCoeff(&axis);
  static constexpr std::array<const char*, 3> kAxes = {"x", "y", "z"};
  const char* name = kAxes[static_cast<size_t>(axis)];
  absl::StrAppend(
      &html, Histogram(deviations, step_m),
      "<p class=\"soft\">Targets by deviation; bars grow with the logarithm of their "
      "number, orange: significant.</p>\n<div class=\"pictures\">",
      Map(deviations, step_m, axis, 1, absl::StrCat("Surface that faces +", name)),
      Map(deviations, step_m, axis, -1, absl::StrCat("Surface that faces \u2212", name)),
      "</div>\n", ColourKey(step_m));
  return html;
}

}  // namespace

std::string AsMeasuredHtml(const v1::AsMeasured& found, int scans, bool for_uncertainty,
                           std::span<const ReportDeviation> deviations) {
  return absl::StrCat(
      "<p class=\"soft\">Points that ", found.scans_size() == 1 ? "a scan has" : "scans have",
      " measured say how the part lies and where its surface is; the other scans were planned for "
      "that part. Poses in plan.json stay those of a part that lies where it should.</p>\n",
      ChangeTable(found, scans, for_uncertainty), "<h3>How the part lies</h3>\n", PoseTable(found),
      Unfixed(found), ScansTable(found), DeviationHtml(found.deviation(), deviations));
}

}  // namespace sightline
