// SPDX-License-Identifier: Apache-2.0
#include "report/diagnosis/image_sections.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "report/document/report_series.h"
#include "report/page/number_text.h"
#include "report/recordings/line_range.h"
#include "report/recordings/raw_picture.h"

namespace sightline {
namespace {

// Number of pictures of the most informative recordings; more would hide the finding.
constexpr int kMaxProfiles = 6;
constexpr int kMaxRegionMaps = 4;

// |z| above which a deeper colour is used: 1 and 2 may be chance, larger values are not.
constexpr double kResidualLevels[] = {1, 2, 3, 5, 10, 20};

// Halos, offsets and background are a few DN next to a line of hundreds: the residual shows if
// faint features matter.
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

// Lower end of a logarithmic profile, so that rows of noise around 0 do not dominate the
// axis.
double LogarithmicLow(const v1::ProfileComparison& profile) {
  double lowest = INFINITY;
  for (const double value : profile.null_dn()) {
    if (value > 0) lowest = std::min(lowest, value);
  }
  const double peak = *std::max_element(profile.observed_dn().begin(), profile.observed_dn().end());
  return std::clamp(0.5 * lowest, 1e-4 * peak, 0.1 * peak);
}

v1::ReportBlock ProfileCard(const DiagnosisView& view, const v1::ProfileComparison& profile) {
  const std::vector<double> rows(profile.row_px().begin(), profile.row_px().end());
  const std::vector<double> observed(profile.observed_dn().begin(), profile.observed_dn().end());
  const std::vector<double> sigma(profile.standard_deviation_dn().begin(),
                                  profile.standard_deviation_dn().end());
  v1::ReportChart signal, residual;
  signal.set_title("Mean over the line");
  *signal.mutable_x() = AxisOf("row", "px");
  *signal.mutable_y() = AxisOf("signal", "DN", NeedsLogarithm(profile));
  residual.set_title("Residual");
  *residual.mutable_x() = signal.x();
  *residual.mutable_y() = AxisOf("residual", "\u03c3");
  for (const double at : {-2, 0, 2}) AddLineAtY(at, &residual);
  if (signal.y().logarithmic()) {
    signal.mutable_y()->set_low(LogarithmicLow(profile));
  } else if (const auto [first, last] = LineRange(rows, observed);
             std::isfinite(first) && first < last) {
    // Profiles whose line differs are shown larger.
    for (v1::ReportChart* chart : {&signal, &residual}) {
      chart->mutable_x()->set_low(first);
      chart->mutable_x()->set_high(last);
    }
  }
  v1::ReportSeries data =
      SeriesOf("observed", v1::REPORT_COLOUR_OBSERVED, v1::ReportSeries::DOTS, rows, observed);
  std::vector<double> two_sigma;
  for (const double s : sigma) two_sigma.push_back(2 * s);
  AddBand("\u00b1 2\u03c3 of the observation", two_sigma, &data);
  *signal.add_series() = std::move(data);
  const auto add = [&](const auto& values, const std::string& name, v1::ReportColour colour,
                       v1::ReportSeries::Mark mark) {
    if (values.empty()) return;
    const std::vector<double> expected(values.begin(), values.end());
    *signal.add_series() = SeriesOf(name, colour, mark, rows, expected);
    if (sigma.empty()) return;
    v1::ReportSeries& z = *residual.add_series();
    z = EmptySeries(name, colour, mark);
    for (size_t i = 0; i < rows.size(); ++i) {
      AddPoint(rows[i], (observed[i] - expected[i]) / sigma[i], &z);
    }
  };
  add(profile.null_dn(), "nominal description, fitted again", v1::REPORT_COLOUR_REFERENCE,
      v1::ReportSeries::DASHED_LINE);
  if (view.has_model) {
    add(profile.model_dn(), view.ModelName(), v1::REPORT_COLOUR_MODEL, v1::ReportSeries::LINE);
  }
  const std::string channel =
      profile.channel().empty() || profile.channel() == "mono" ? "" : ", " + profile.channel();
  ReportBlocks blocks = {ChartBlock(std::move(signal))};
  if (!residual.series().empty()) blocks.push_back(ChartBlock(std::move(residual)));
  return CardBlock(view.CaptionTitle(profile.recording(), channel),
                   view.CaptionSetup(profile.recording()), std::move(blocks));
}

v1::ReportBlock ResidualMap(const v1::RegionMap& map,
                            const google::protobuf::RepeatedField<float>& z, const char* what) {
  v1::ReportBlock block;
  v1::ReportMap& made = *block.mutable_map();
  double squares = 0;
  int finite = 0;
  for (const float value : z) {
    if (!std::isfinite(value)) continue;
    squares += static_cast<double>(value) * value;
    ++finite;
  }
  made.set_title(absl::StrCat(
      what, finite > 0 ? absl::StrCat(", rms ", Number(std::sqrt(squares / finite), 2)) : ""));
  made.set_value_name("standardised residual");
  made.set_rows(map.rows());
  made.set_columns(map.columns());
  *made.mutable_row_edges_px() = map.row_edges_px();
  *made.mutable_column_edges_px() = map.column_edges_px();
  *made.mutable_values() = z;
  for (const double level : kResidualLevels) made.add_levels(level);
  return block;
}

v1::ReportBlock RegionMapCard(const DiagnosisView& view, const v1::RegionMap& map) {
  ReportBlocks panes;
  if (!map.null_z().empty()) {
    panes.push_back(ResidualMap(map, map.null_z(), view.has_model ? "before" : "residual"));
  }
  if (view.has_model && !map.model_z().empty()) {
    panes.push_back(ResidualMap(map, map.model_z(), "after"));
  }
  if (const v1::Recording* recording = view.RecordingAt(map.recording()); recording != nullptr) {
    const std::string png = RawPicturePng(view.set_folder, recording->file());
    if (!png.empty()) {
      panes.insert(view.of_part ? panes.begin() : panes.end(),
                   PictureBlock(png, "recorded, square root of the signal",
                                absl::StrCat("Recording ", map.recording()), true));
    }
  }
  if (panes.empty()) panes.push_back(RemarkBlock("There are no residuals."));
  return CardBlock(view.CaptionTitle(map.recording()), view.CaptionSetup(map.recording()),
                   {GroupBlock(v1::ReportGroup::THREE_COLUMNS, std::move(panes))});
}

}  // namespace

ReportBlocks ProfileBlocks(const DiagnosisView& view) {
  ReportBlocks cards;
  int count = 0;
  for (const v1::ProfileComparison& profile : view.diagnosis.profiles()) {
    if (profile.row_px().empty()) continue;
    if (++count <= kMaxProfiles) cards.push_back(ProfileCard(view, profile));
  }
  if (cards.empty()) return {};
  const int shown = std::min(count, kMaxProfiles);
  return {RemarkBlock(absl::StrCat(
              "Mean profile across the line; below it what is left, in standard deviations. ",
              view.has_model ? "The recordings that tell most" : "The recordings that differ most",
              count > shown ? absl::StrCat(", ", shown, " of ", count, ".") : ".")),
          GroupBlock(v1::ReportGroup::TWO_COLUMNS, std::move(cards))};
}

ReportBlocks RegionMapBlocks(const DiagnosisView& view) {
  ReportBlocks cards;
  int count = 0;
  for (const v1::RegionMap& map : view.diagnosis.region_maps()) {
    if (map.rows() == 0 || map.columns() == 0) continue;
    if (++count <= kMaxRegionMaps) cards.push_back(RegionMapCard(view, map));
  }
  if (cards.empty()) return {};
  const int shown = std::min(count, kMaxRegionMaps);
  return {RemarkBlock(absl::StrCat(
              "Standardised residuals over the image: orange where more light was recorded than "
              "expected, blue where less, pale where it is chance.",
              count > shown ? absl::StrCat(" ", shown, " of ", count, ".") : "")),
          GroupBlock(v1::ReportGroup::STACK, std::move(cards))};
}

}  // namespace sightline
