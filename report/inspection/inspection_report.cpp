// SPDX-License-Identifier: Apache-2.0
#include "report/inspection/inspection_report.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "core/status/status_macros.h"
#include "report/document/report_parts.h"
#include "report/page/number_text.h"

namespace sightline {
namespace {

const char* DecisionText(v1::InspectedFeature::Decision decision) {
  switch (decision) {
    case v1::InspectedFeature::CONFORMS:
      return "conforms";
    case v1::InspectedFeature::DOES_NOT_CONFORM:
      return "does not conform";
    case v1::InspectedFeature::UNDECIDED:
      return "undecided";
    default:
      return "not evaluated";
  }
}

v1::ReportCell KnownMillimetres(bool known, double length_m, int decimals) {
  if (!known) return TextCell(kNoValue);
  return NumberCell(1e3 * length_m, FixedNumber(1e3 * length_m, decimals));
}

v1::ReportCell ZoneCell(const v1::InspectedFeature& f) {
  if (f.has_lower_limit_m() && f.has_upper_limit_m()) {
    return TextCell(absl::StrCat(FixedNumber(1e3 * f.lower_limit_m(), 3), " to ",
                                 FixedNumber(1e3 * f.upper_limit_m(), 3)));
  }
  return f.has_zone_width_m() ? TextCell(FixedNumber(1e3 * f.zone_width_m(), 3))
                              : TextCell(kNoValue);
}

ReportBlocks InspectedFeatureBlocks(const v1::InspectionResult& result) {
  std::vector<ReportCells> rows;
  for (const v1::InspectedFeature& f : result.features()) {
    rows.push_back({TextCell(f.name()), TextCell(f.kind()),
                    KnownMillimetres(f.has_value_m(), f.value_m(), 4),
                    KnownMillimetres(f.has_expanded_uncertainty_m(), f.expanded_uncertainty_m(), 4),
                    ZoneCell(f), StrongCell(DecisionText(f.decision())), TextCell(f.because())});
  }
  if (rows.empty()) return {RemarkBlock("The inspection has no toleranced features.")};
  return {TableBlock("Features",
                     {WordsColumn("feature"), WordsColumn("kind"), NumberColumn("value", "mm"),
                      NumberColumn("U (k = 2)", "mm"), WordsColumn("zone or limits [mm]"),
                      WordsColumn("decision"), WordsColumn("because")},
                     rows)};
}

// Deviations of profiles within their zones.
ReportBlocks ProfileBlocks(const v1::InspectionResult& result) {
  std::vector<ReportCells> rows;
  for (const v1::InspectedFeature& f : result.features()) {
    if (!f.has_largest_deviation_m()) continue;
    const auto& p = f.worst_place_m();
    rows.push_back(
        {TextCell(f.name()), KnownMillimetres(true, f.smallest_deviation_m(), 3),
         KnownMillimetres(true, f.largest_deviation_m(), 3),
         TextCell("± " + FixedNumber(0.5e3 * f.zone_width_m(), 3)),
         TextCell(absl::StrFormat("%.1f, %.1f, %.1f", 1e3 * p.x(), 1e3 * p.y(), 1e3 * p.z())),
         TextCell(absl::StrCat(f.measured_targets(), " of ", f.targets()))});
  }
  if (rows.empty()) return {};
  return {TableBlock(
      "Profiles",
      {WordsColumn("profile"), NumberColumn("smallest", "mm"), NumberColumn("largest", "mm"),
       WordsColumn("zone [mm]"), WordsColumn("worst place [mm]"), WordsColumn("targets measured")},
      rows)};
}

ReportBlocks ScanBlocks(const v1::InspectionResult& result) {
  std::vector<ReportCells> rows;
  for (const v1::InspectedScan& scan : result.scans()) {
    rows.push_back({TextCell(scan.name()), CountCell(scan.scan()), CountCell(scan.points()),
                    CountCell(scan.outliers_among_neighbours()),
                    CountCell(scan.outliers_off_the_model()), CountCell(scan.duplicates()),
                    CountCell(scan.without_value()),
                    KnownMillimetres(true, scan.registration_rms_m(), 4)});
  }
  if (rows.empty()) return {};
  return {TableBlock("Scans",
                     {WordsColumn("file"), NumberColumn("scan"), NumberColumn("points"),
                      NumberColumn("outliers among neighbours"), NumberColumn("far from the part"),
                      NumberColumn("repeated"), NumberColumn("without value"),
                      NumberColumn("rms to the model", "mm")},
                     rows)};
}

v1::ReportCell FixedNumberCell(double number, int decimals) {
  return NumberCell(number, FixedNumber(number, decimals));
}

ReportBlocks NextScanBlocks(const v1::InspectionResult& result) {
  if (!result.has_next_scan()) return {};
  const v1::NextScan& next = result.next_scan();
  const v1::Measurement& m = next.measurement();
  return {
      TextBlock(absl::StrCat("For ", absl::StrJoin(next.features(), ", "), ": it settles ",
                             next.settled_targets(), " of ", next.open_targets(),
                             " open targets.")),
      TableBlock(
          "Next scan",
          {NumberColumn("camera distance", "mm"), NumberColumn("triangulation angle", "°"),
           NumberColumn("camera azimuth", "°"), NumberColumn("camera polar", "°"),
           WordsColumn("part α, β, γ [°]"), WordsColumn("offsets y, z [mm]")},
          {{FixedNumberCell(1e3 * m.camera_distance_m(), 1),
            FixedNumberCell(m.triangulation_angle_deg(), 2),
            FixedNumberCell(m.camera_azimuth_deg(), 2), FixedNumberCell(m.camera_polar_deg(), 2),
            TextCell(absl::StrFormat("%.2f, %.2f, %.2f", m.part_alpha_deg(), m.part_beta_deg(),
                                     m.part_gamma_deg())),
            TextCell(absl::StrFormat("%.1f, %.1f", 1e3 * m.offset_y_m(), 1e3 * m.offset_z_m()))}})};
}

ReportBlocks PoseBlocks(const v1::AsMeasured& m) {
  const auto row = [](const char* name, const v1::Vector3& v, const v1::Vector3& sd, double scale) {
    const auto with = [&](double value, double deviation) {
      return NumberCell(scale * value, absl::StrCat(FixedNumber(scale * value, 4), " ± ",
                                                    FixedNumber(2 * scale * deviation, 4)));
    };
    return ReportCells{TextCell(name), with(v.x(), sd.x()), with(v.y(), sd.y()),
                       with(v.z(), sd.z())};
  };
  return {
      TableBlock("Pose of the part",
                 {WordsColumn("quantity"), NumberColumn("x"), NumberColumn("y"), NumberColumn("z")},
                 {row("shift [mm]", m.translation_m(), m.translation_standard_deviation_m(), 1e3),
                  row("turn [°]", m.rotation_deg(), m.rotation_standard_deviation_deg(), 1)})};
}

}  // namespace

absl::StatusOr<v1::Report> InspectionReport(const v1::InspectionResult& result,
                                            const SurfaceDeviations& surface) {
  SIGHTLINE_ASSIGN_OR_RETURN(auto views, DeviationViews(surface));
  std::array<int64_t, 5> counts{};
  for (const v1::InspectedFeature& f : result.features()) {
    ++counts[static_cast<size_t>(f.decision())];
  }
  v1::Report report;
  report.set_title("Inspection: " + result.inspection_name());
  report.set_kind("inspection");
  report.set_subject("Sightline · measured part");
  report.set_heading(result.inspection_name());
  *report.add_finding() = PlainRun(absl::StrFormat("Of %d features ", result.features_size()));
  *report.add_finding() =
      StrongRun(absl::StrFormat("%d conform, %d do not", counts[v1::InspectedFeature::CONFORMS],
                                counts[v1::InspectedFeature::DOES_NOT_CONFORM]));
  *report.add_finding() = PlainRun(absl::StrFormat(
      ", %d are undecided and %d are not evaluated (ISO 14253-1, guard factor %.3g).",
      counts[v1::InspectedFeature::UNDECIDED], counts[v1::InspectedFeature::NOT_EVALUATED],
      result.guard_factor()));
  *report.add_figures() =
      CountFact("do not conform", counts[v1::InspectedFeature::DOES_NOT_CONFORM]);
  *report.add_figures() = CountFact("undecided", counts[v1::InspectedFeature::UNDECIDED]);
  *report.add_figures() = CountFact("scans", result.scans_size());
  *report.add_figures() =
      NumberFact("targets measured", static_cast<double>(result.surface().measured_targets()), "",
                 absl::StrCat(GroupedInteger(result.surface().measured_targets()), " of ",
                              GroupedInteger(result.surface().targets())));
  *report.mutable_warnings() = result.warnings();
  AddSection(&report, "features", "Features", InspectedFeatureBlocks(result));
  AddSection(&report, "next", "Next scan", NextScanBlocks(result));
  AddSection(&report, "surface", "Surface", std::move(views));
  AddSection(&report, "profiles", "Profiles", ProfileBlocks(result));
  AddSection(&report, "scans", "Scans", ScanBlocks(result));
  AddSection(&report, "pose", "Pose of the part (± two standard deviations)",
             PoseBlocks(result.as_measured()));
  return report;
}

}  // namespace sightline
