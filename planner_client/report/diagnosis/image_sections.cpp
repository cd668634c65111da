// SPDX-License-Identifier: Apache-2.0
#include "planner_client/report/diagnosis/image_sections.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "planner_client/report/charts/region_map_picture.h"
#include "planner_client/report/charts/xy_chart.h"
#include "planner_client/report/diagnosis/diagnosis_view.h"
#include "planner_client/report/page/html.h"
#include "planner_client/report/page/number_text.h"
#include "planner_client/report/page/static_page.h"
#include "planner_client/report/recordings/line_range.h"
#include "planner_client/report/recordings/raw_picture.h"

namespace sightline {
namespace {

// Pictures of the most telling recordings; more would hide the finding.
constexpr int kMaxProfiles = 6;
constexpr int kMaxRegionMaps = 4;

// Halos, offsets and background are a few DN beside a line of hundreds: the residual tells
// whether faint parts matter.
bool NeedsLogarithm(const v1::ProfileComparison& profile) {
  const double peak = *std::max_element(profile.observed_dn().begin(), profile.observed_dn().end());
  double all = 0, faint = 0;
  for (int i = 0; i < profile.row_px_size(); ++i) {
    const double sigma =
        profile.standard_deviation_dn_size() > 0 ? profile.standard_deviation_dn(i) : 1;
    const double z = (profile.observed_dn(i) - profile.null_dn(i)) / sigma;
    if (!std::isfinite(z)) continue;
    all += z * z;
    if (profile.observed_dn(i) < 0.15 * peak) faint += z * z;
  }
  return peak > 0 && faint > 0.5 * all;
}

std::string ProfileCard(const DiagnosisView& view, const v1::ProfileComparison& profile) {
  const std::vector<double> rows(profile.row_px().begin(), profile.row_px().end());
  const std::vector<double> observed(profile.observed_dn().begin(), profile.observed_dn().end());
  const std::vector<double> sigma(profile.standard_deviation_dn().begin(),
                                  profile.standard_deviation_dn().end());
  XyChart signal, residual;
  signal.height = 240;
  signal.hide_x_labels = true;
  signal.y.title = "mean over the line [DN]";
  if (NeedsLogarithm(profile)) {
    signal.y.logarithmic = true;
    signal.y.title += ", log";
    // Rows of noise about 0 shall not take the axis.
    double lowest = INFINITY;
    for (const double value : profile.null_dn()) {
      if (value > 0) lowest = std::min(lowest, value);
    }
    const double peak = *std::max_element(observed.begin(), observed.end());
    signal.y.low = std::clamp(0.5 * lowest, 1e-4 * peak, 0.1 * peak);
  }
  // Where the line itself is what differs, it is shown larger.
  if (!signal.y.logarithmic) {
    const auto [first, last] = LineRange(rows, observed);
    if (std::isfinite(first) && first < last) {
      signal.x.low = residual.x.low = first;
      signal.x.high = residual.x.high = last;
    }
  }
  ChartSeries data{"observed", SeriesMark::kDots, rows, observed, {}, {}};
  for (const double s : sigma) data.half_band.push_back(2 * s);
  signal.series.push_back(data);

  residual.height = 180;
  residual.x.title = "row [px]";
  residual.y.title = "residual [\u03c3]";
  residual.marks = {-2, 0, 2};
  const auto add = [&](const auto& values, const char* css_class, SeriesMark mark) {
    if (values.empty()) return;
    const std::vector<double> expected(values.begin(), values.end());
    signal.series.push_back({css_class, mark, rows, expected, {}, {}});
    if (sigma.empty()) return;
    ChartSeries z{css_class, mark, rows, {}, {}, {}};
    for (size_t i = 0; i < rows.size(); ++i) z.y.push_back((observed[i] - expected[i]) / sigma[i]);
    residual.series.push_back(std::move(z));
  };
  add(profile.null_dn(), "null", SeriesMark::kDashedLine);
  if (view.has_model) add(profile.model_dn(), "model", SeriesMark::kLine);
  const std::string channel =
      profile.channel().empty() || profile.channel() == "mono" ? "" : ", " + profile.channel();
  return absl::StrCat("<div class=\"card\">", view.Caption(profile.recording(), channel),
                      XyChartSvg(signal), residual.series.empty() ? "" : XyChartSvg(residual),
                      "</div>\n");
}

}  // namespace

std::string ProfilesHtml(const DiagnosisView& view) {
  std::string cards;
  int count = 0, shown = 0;
  for (const v1::ProfileComparison& profile : view.diagnosis.profiles()) {
    if (profile.row_px().empty()) continue;
    ++count;
    if (shown == kMaxProfiles) continue;
    cards += ProfileCard(view, profile);
    ++shown;
  }
  if (shown == 0) return "";
  std::vector<KeyEntry> key = {
      {"observed", KeyShape::kDot, "observed"},
      {"observed", KeyShape::kBand, "\u00b1 2\u03c3 of the observation"},
      {"null", KeyShape::kDashedLine, "nominal description, fitted again"}};
  if (view.has_model) key.push_back({"model", KeyShape::kLine, view.ModelName()});
  return absl::StrCat(
      SoftParagraph(absl::StrCat(
          "Mean profile across the line; below it what is left, in standard deviations. ",
          view.has_model ? "The recordings that tell most" : "The recordings that differ most",
          count > shown ? absl::StrCat(", ", shown, " of ", count, ".") : ".")),
      ChartKey(key), "<div class=\"cards\">\n", cards, "</div>\n");
}

std::string RegionMapsHtml(const DiagnosisView& view) {
  std::string cards;
  int count = 0, shown = 0;
  for (const v1::RegionMap& map : view.diagnosis.region_maps()) {
    if (map.rows() == 0 || map.columns() == 0) continue;
    ++count;
    if (shown == kMaxRegionMaps) continue;
    ++shown;
    const auto pane = [&](const google::protobuf::RepeatedField<float>& z, const char* what) {
      if (z.empty()) return std::string();
      RegionMapGrid grid;
      grid.rows = map.rows();
      grid.columns = map.columns();
      grid.row_edges_px.assign(map.row_edges_px().begin(), map.row_edges_px().end());
      grid.column_edges_px.assign(map.column_edges_px().begin(), map.column_edges_px().end());
      grid.z.assign(z.begin(), z.end());
      double squares = 0;
      int finite = 0;
      for (const float value : z) {
        if (!std::isfinite(value)) continue;
        squares += static_cast<double>(value) * value;
        ++finite;
      }
      const std::string title =
          absl::StrCat("Standardised residuals of recording ", map.recording(), ", ", what);
      return absl::StrCat(
          "<figure><figcaption>", what,
          finite > 0 ? absl::StrCat(", rms ", Number(std::sqrt(squares / finite), 2)) : "",
          "</figcaption>", RegionMapSvg(grid, title), "</figure>\n");
    };
    std::string picture;
    if (const v1::Recording* recording = view.RecordingAt(map.recording()); recording != nullptr) {
      const std::string png = RawPicturePng(view.set_folder, recording->file());
      if (!png.empty()) {
        picture = absl::StrCat(
            "<figure><figcaption>recorded, square root of the signal</figcaption><img alt=\"",
            "Recording ", map.recording(), "\" src=\"", PngDataUri(png), "\"></figure>\n");
      }
    }
    absl::StrAppend(&cards, "<div class=\"card map-card\">", view.Caption(map.recording()),
                    "<div class=\"panes\">\n", view.of_part ? picture : "",
                    pane(map.null_z(), view.has_model ? "before" : "residual"),
                    view.has_model ? pane(map.model_z(), "after") : "", view.of_part ? "" : picture,
                    "</div></div>\n");
  }
  if (shown == 0) return "";
  return absl::StrCat(SoftParagraph(absl::StrCat(
                          "Standardised residuals over the image: orange where more light was "
                          "recorded than expected, blue where less, pale where it is chance.",
                          count > shown ? absl::StrCat(" ", shown, " of ", count, ".") : "")),
                      RegionMapKeySvg(), "<div class=\"cards one\">\n", cards, "</div>\n");
}

}  // namespace sightline
