// SPDX-License-Identifier: Apache-2.0
#include "report/plan/sections/as_measured_section.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/status/status_macros.h"
#include "report/document/report_series.h"
#include "report/inspection/deviation_views.h"
#include "report/page/html.h"
#include "report/page/number_text.h"
#include "report/plan/sections/plan_text.h"

namespace sightline {
namespace {

// "0.123 ± 0.004", two digits of the uncertainty.
std::string WithUncertainty(double value, double uncertainty) {
  if (!(uncertainty > 0)) return Number(value);
  const int decimals = std::clamp(1 - static_cast<int>(std::floor(std::log10(uncertainty))), 0, 7);
  return absl::StrCat(FixedNumber(value, decimals), " \u00b1 ", FixedNumber(uncertainty, decimals));
}

v1::ReportBlock FoundPoseTable(const v1::AsMeasured& found) {
  const auto row = [](const std::string& name, const v1::Vector3& value,
                      const v1::Vector3& deviation, double scale, const std::string& unit) {
    ReportCells cells = {TextCell(name)};
    for (const auto& [v, s] :
         {std::pair{value.x(), deviation.x()}, std::pair{value.y(), deviation.y()},
          std::pair{value.z(), deviation.z()}}) {
      cells.push_back(NumberCell(scale * v, WithUncertainty(scale * v, 2 * scale * s), unit));
    }
    return cells;
  };
  return TableBlock("Pose of the part as it was found",
                    {WordsColumn(""), NumberColumn("x"), NumberColumn("y"), NumberColumn("z")},
                    {row("shift, mm (\u00b1 2\u03c3)", found.translation_m(),
                         found.translation_standard_deviation_m(), 1e3, "mm"),
                     row("turn, \u00b0 (\u00b1 2\u03c3)", found.rotation_deg(),
                         found.rotation_standard_deviation_deg(), 1, "\u00b0")});
}

std::string Triple(const v1::Vector3& v, double scale, int decimals) {
  return absl::StrCat(FixedNumber(scale * v.x(), decimals), ", ",
                      FixedNumber(scale * v.y(), decimals), ", ",
                      FixedNumber(scale * v.z(), decimals));
}

ReportBlocks Unfixed(const v1::AsMeasured& found) {
  if (found.not_fixed().empty()) return {TextBlock("The points fix all six degrees of freedom.")};
  std::vector<std::vector<v1::ReportRun>> movements;
  for (const v1::PoseMovement& m : found.not_fixed()) {
    movements.push_back({PlainRun(
        absl::StrCat("turn (", Triple(m.rotation_deg(), 1, 2), ")\u202f\u00b0 with shift (",
                     Triple(m.translation_m(), 1e3, 2), ")\u202fmm: known to ",
                     Percent(m.standard_deviation_relative(), 2), " of the prior"))});
  }
  return {ParagraphBlock({StrongRun(absl::StrCat("The points do not fix ", found.not_fixed_size(),
                                                 " of the six degrees of freedom")),
                          PlainRun(absl::StrCat(
                              "; there the prior stays: ",
                              QuantityText("x_m", found.prior_translation_standard_deviation_m()),
                              " along and ", Number(found.prior_rotation_standard_deviation_deg()),
                              "\u202f\u00b0 about each axis (standard deviations)."))}),
          ListBlock(movements)};
}

v1::ReportBlock MeasuredScansTable(const v1::AsMeasured& found) {
  std::vector<ReportCells> rows;
  for (const v1::MeasuredScan& scan : found.scans()) {
    v1::ReportCell number = CountCell(scan.scan());
    if (scan.scan() != scan.earlier_scan()) {
      number.set_detail(absl::StrCat("was ", scan.earlier_scan()));
    }
    rows.push_back({number, TextCell(scan.file()), CountCell(scan.points()),
                    MillimetreCell(scan.median_distance_m(), 3),
                    MillimetreCell(scan.upper_quartile_distance_m(), 3),
                    CountCell(scan.covered_targets()),
                    CountCell(scan.simulated_covered_targets())});
  }
  return TableBlock(
      "Measured scans",
      {NumberColumn("measured scan"), WordsColumn("file"), NumberColumn("points"),
       NumberColumn("median distance", "mm"), NumberColumn("three quarters within", "mm"),
       NumberColumn("targets by points"), NumberColumn("by simulation")},
      rows);
}

v1::ReportBlock ChangeTable(const v1::AsMeasured& found, int scans, bool for_uncertainty) {
  const auto row = [](const std::string& name, int count, double satisfied) {
    return ReportCells{TextCell(name), CountCell(count), PercentCell(satisfied, 2)};
  };
  return TableBlock(
      "Plans on the part as it was found",
      {WordsColumn("on the part as it was found"), NumberColumn("scans"),
       NumberColumn(for_uncertainty ? "known admissibly" : "measured")},
      {row("measured scans, by their points", found.scans_size(), found.measured_settled()),
       row("earlier plan", found.earlier_scans(), found.earlier_settled()),
       row("this plan", scans, found.settled())});
}

// The largest significant deviation.
double LargestDeviation_m(std::span<const ReportDeviation> deviations) {
  double largest_m = 0;
  for (const ReportDeviation& d : deviations) {
    if (d.significant) largest_m = std::max<double>(largest_m, std::abs(d.deviation_m));
  }
  return std::max(largest_m, 3.5e-7);
}

v1::ReportBlock Histogram(std::span<const ReportDeviation> deviations) {
  constexpr int kBins = 41;
  const double range_m = LargestDeviation_m(deviations), bin_m = 2 * range_m / kBins;
  std::array<int, kBins> counts{}, significant{};
  for (const ReportDeviation& d : deviations) {
    const int bin =
        std::clamp(static_cast<int>(std::floor((d.deviation_m + range_m) / bin_m)), 0, kBins - 1);
    ++counts[static_cast<size_t>(bin)];
    significant[static_cast<size_t>(bin)] += d.significant;
  }
  v1::ReportChart chart;
  chart.set_title("Targets by deviation");
  *chart.mutable_x() = AxisOf("deviation, positive outside", "mm");
  *chart.mutable_y() = AxisOf("targets", "", /*logarithmic=*/true);
  v1::ReportSeries all =
      EmptySeries("all", v1::REPORT_COLOUR_UNSPECIFIED, v1::ReportSeries::HOLLOW_DOTS);
  v1::ReportSeries sure =
      EmptySeries("significant", v1::REPORT_COLOUR_REFERENCE, v1::ReportSeries::DOTS);
  for (size_t b = 0; b < counts.size(); ++b) {
    const double at_mm = 1e3 * (-range_m + (static_cast<double>(b) + 0.5) * bin_m);
    if (counts[b] > 0) AddPoint(at_mm, counts[b], &all);
    if (significant[b] > 0) AddPoint(at_mm, significant[b], &sure);
  }
  *chart.add_series() = all;
  *chart.add_series() = sure;
  return ChartBlock(chart);
}

// Insignificant deviations are drawn as zero.
absl::StatusOr<ReportBlocks> Views(std::span<const ReportDeviation> deviations) {
  TargetSet targets;
  SurfaceDeviations surface;
  for (const ReportDeviation& d : deviations) {
    targets.positions_m.push_back(d.position_m);
    targets.normals.push_back(d.normal);
    surface.deviations_m.push_back(d.significant ? d.deviation_m : 0);
  }
  surface.measured.assign(deviations.size(), 1);
  surface.targets = &targets;
  surface.scale_m = LargestDeviation_m(deviations);
  return DeviationViews(surface);
}

v1::ReportBlock DeviationText(const v1::SurfaceDeviation& found) {
  std::vector<v1::ReportRun> runs = {PlainRun(absl::StrCat(
      "The points tell of ", GroupedInteger(found.known_targets()),
      " targets; the surface deviates significantly (", FixedNumber(found.significance_level(), 1),
      " standard uncertainties or more) at ", GroupedInteger(found.significant_targets()),
      " of them"))};
  if (found.significant_targets() > 0) {
    runs.push_back(PlainRun(absl::StrCat(", by ", QuantityText("x_m", found.root_mean_square_m()),
                                         " root mean square and ")));
    runs.push_back(StrongRun(absl::StrCat(
        "at most by ",
        WithUncertainty(1e3 * found.largest_m(), 2e3 * found.largest_uncertainty_m()), " mm")));
    runs.push_back(PlainRun(absl::StrCat(" (\u00b1 2u, positive outside) at x, y, z = ",
                                         Triple(found.largest_place_m(), 1e3, 1), " mm")));
  }
  runs.push_back(PlainRun("."));
  return ParagraphBlock(runs);
}

}  // namespace

absl::StatusOr<ReportBlocks> AsMeasuredBlocks(const v1::AsMeasured& found, int scans,
                                              bool for_uncertainty,
                                              std::span<const ReportDeviation> deviations) {
  ReportBlocks pose = {FoundPoseTable(found)};
  pose.push_back(RemarkBlock(absl::StrCat(
      "Shift of the centre of the model's bounding box, turn about it. The points lie ",
      QuantityText("x_m", found.residual_standard_deviation_m()),
      " (robust standard deviation) from the model there. Errors that all points of a scan share "
      "are not in the uncertainty of the pose.")));
  for (const v1::ReportBlock& block : Unfixed(found)) pose.push_back(block);
  pose.push_back(MeasuredScansTable(found));
  ReportBlocks deviation = {DeviationText(found.deviation())};
  if (!deviations.empty()) {
    deviation.push_back(Histogram(deviations));
    SIGHTLINE_ASSIGN_OR_RETURN(auto views, Views(deviations));
    deviation.push_back(RemarkBlock("Deviations that are not significant are grey."));
    for (const v1::ReportBlock& block : views) deviation.push_back(block);
  }
  return ReportBlocks{
      RemarkBlock(absl::StrCat(
          "Points that ", found.scans_size() == 1 ? "a scan has" : "scans have",
          " measured say how the part lies and where its surface is; the other scans were planned "
          "for that part. Poses in plan.json stay those of a part that lies where it should.")),
      ChangeTable(found, scans, for_uncertainty), TitledBlock("How the part lies", pose),
      TitledBlock("Deviation from the CAD model", deviation)};
}

}  // namespace sightline
