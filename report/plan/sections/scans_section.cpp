// SPDX-License-Identifier: Apache-2.0
#include "report/plan/sections/scans_section.h"

#include <algorithm>
#include <vector>

#include "absl/strings/str_cat.h"
#include "report/page/number_text.h"
#include "report/plan/sections/plan_text.h"
#include "report/plan/sections/setups_section.h"

namespace sightline {
namespace {

v1::ReportColumn Grouped(const std::string& group, v1::ReportColumn column) {
  column.set_group(group);
  return column;
}

std::vector<v1::ReportColumn> Columns(bool for_uncertainty) {
  constexpr char kSensors[] = "Camera and laser", kPart[] = "Part", kStage[] = "Stage",
                 kTargets[] = "Targets", kKnown[] = "Known well enough";
  std::vector<v1::ReportColumn> columns = {NumberColumn("scan"),
                                           WordsColumn(""),
                                           Grouped(kSensors, NumberColumn("distance", "mm")),
                                           Grouped(kSensors, NumberColumn("\u03c4", "\u00b0")),
                                           Grouped(kSensors, NumberColumn("\u03c6", "\u00b0")),
                                           Grouped(kSensors, NumberColumn("\u03b8", "\u00b0")),
                                           Grouped(kPart, NumberColumn("\u03b1", "\u00b0")),
                                           Grouped(kPart, NumberColumn("\u03b2", "\u00b0")),
                                           Grouped(kPart, NumberColumn("\u03b3", "\u00b0")),
                                           Grouped(kPart, NumberColumn("y", "mm")),
                                           Grouped(kPart, NumberColumn("z", "mm")),
                                           Grouped(kStage, NumberColumn("start", "mm")),
                                           Grouped(kStage, NumberColumn("end", "mm")),
                                           Grouped(kStage, NumberColumn("frames")),
                                           Grouped(kStage, NumberColumn("time", "s")),
                                           Grouped(kTargets, NumberColumn("measured")),
                                           Grouped(kTargets, NumberColumn("new")),
                                           Grouped(kTargets, NumberColumn("sum"))};
  if (for_uncertainty) {
    columns.push_back(Grouped(kKnown, NumberColumn("admissible")));
    columns.push_back(Grouped(kKnown, NumberColumn("relaxed")));
  }
  return columns;
}

v1::ReportCell PictureCell(const ReportScan& scan, int index) {
  v1::ReportCell cell;
  if (scan.rendered_view_png.empty()) return cell;
  cell.mutable_picture()->set_png(scan.rendered_view_png);
  cell.mutable_picture()->set_alternative(absl::StrCat("Scan ", index, ": part, camera and laser"));
  return cell;
}

// Share of `all` targets.
v1::ReportCell Fraction(int64_t targets, int64_t all) {
  return PercentCell(static_cast<double>(targets) / static_cast<double>(std::max<int64_t>(1, all)));
}

ReportCells RowOf(const ReportData& data, int i) {
  const v1::PlannedScan& scan = data.plan.scans(i);
  const v1::Measurement& m = scan.measurement();
  v1::ReportCell number = CountCell(scan.index());
  number.set_strong(true);
  if (scan.locked()) number.set_detail("locked");
  ReportCells row = {
      number,
      PictureCell(data.scans[static_cast<size_t>(i)], scan.index()),
      MillimetreCell(m.camera_distance_m()),
      FixedCell(m.triangulation_angle_deg(), 2),
      FixedCell(m.camera_azimuth_deg(), 2),
      FixedCell(m.camera_polar_deg(), 2),
      FixedCell(m.part_alpha_deg(), 2),
      FixedCell(m.part_beta_deg(), 2),
      FixedCell(m.part_gamma_deg(), 2),
      MillimetreCell(m.offset_y_m()),
      MillimetreCell(m.offset_z_m()),
      MillimetreCell(scan.stage_start_m(), 0),
      MillimetreCell(scan.stage_end_m(), 0),
      CountCell(scan.trigger_positions_m_size()),
      scan.scan_time_s() > 0 ? FixedCell(scan.scan_time_s(), 1) : TextCell(kNoValue),
      CountCell(scan.covered_targets()),
      CountCell(scan.new_targets()),
      Fraction(scan.cumulative_targets(), data.plan.coverage().measurable_targets())};
  if (data.plan.has_uncertainty()) {
    const int64_t toleranced = data.plan.uncertainty().judged_targets();
    row.push_back(Fraction(scan.cumulative_admissible_targets(), toleranced));
    row.push_back(Fraction(scan.cumulative_relaxed_targets(), toleranced));
  }
  return row;
}

}  // namespace

ReportBlocks ScansBlocks(const ReportData& data) {
  if (data.scans.empty()) return {TextBlock("The plan has no scans.")};
  std::vector<ReportCells> rows;
  for (int i = 0; i < data.plan.scans_size(); ++i) rows.push_back(RowOf(data, i));
  v1::ReportBlock table = TableBlock("Scans", Columns(data.plan.has_uncertainty()), rows);
  for (int i = 0; i < data.plan.scans_size(); ++i) {
    ShowScan(i, table.mutable_table()->mutable_rows(i));
  }
  ReportBlocks blocks = {
      RemarkBlock("Select a row to see the scan in the part above; press a picture to enlarge it. "
                  "Camera distance, triangulation angle \u03c4, azimuth \u03c6 and polar angle "
                  "\u03b8 place camera and laser; \u03b1, \u03b2, \u03b3 turn the part about x, y, "
                  "z; y and z shift it."),
      table};
  if (!data.set_up_sheet.empty()) {
    v1::ReportRun link = PlainRun("set-up sheet");
    link.set_link(data.set_up_sheet);
    blocks.push_back(ParagraphBlock({PlainRun("To set them up: "), link,
                                     PlainRun(", pages to print and take to the machine.")}));
  }
  return blocks;
}

}  // namespace sightline
