// SPDX-License-Identifier: Apache-2.0
#include "report/plan/sections/quality_section.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "report/page/number_text.h"
#include "report/plan/sections/plan_text.h"

namespace sightline {
namespace {

// Text of the median and, on a second line, of the smallest and the largest value.
v1::ReportCell SpreadCell(const v1::ScanQuality::Spread& spread, double factor, int decimals) {
  return NumberCell(factor * spread.median(), FixedNumber(factor * spread.median(), decimals), "",
                    absl::StrCat(FixedNumber(factor * spread.low(), decimals), " \u2026 ",
                                 FixedNumber(factor * spread.high(), decimals)));
}

ReportCells RowOf(const v1::PlannedScan& scan) {
  ReportCells row = {CountCell(scan.index())};
  if (!scan.has_quality()) {
    row.push_back(TextCell("measures nothing"));
    row.resize(7);
    return row;
  }
  const v1::ScanQuality& quality = scan.quality();
  for (v1::ReportCell& cell : std::vector<v1::ReportCell>{
           SpreadCell(quality.pixel_footprint_m(), 1e3, 3),
           SpreadCell(quality.depth_per_pixel_m(), 1e3, 3),
           SpreadCell(quality.triangulation_angle_deg(), 1, 1),
           SpreadCell(quality.camera_incidence_deg(), 1, 0),
           SpreadCell(quality.laser_incidence_deg(), 1, 0), PercentCell(quality.overlap(), 0)}) {
    row.push_back(std::move(cell));
  }
  return row;
}

}  // namespace

ReportBlocks QualityBlocks(const v1::Plan& plan) {
  const bool any = std::any_of(plan.scans().begin(), plan.scans().end(),
                               [](const v1::PlannedScan& scan) { return scan.has_quality(); });
  if (!any) return {};
  std::vector<ReportCells> rows;
  for (const v1::PlannedScan& scan : plan.scans()) rows.push_back(RowOf(scan));
  return {
      RemarkBlock("Over all points of a scan: the median, and the limits between which 95 of 100 "
                  "lie. Depth per pixel is the pixel\u2019s size on the part over the sine of the "
                  "angle between line of sight and laser plane; incidence is counted from the "
                  "surface\u2019s normal; overlap is the part of a scan\u2019s targets that others "
                  "measure as well."),
      TableBlock("How finely each scan measures",
                 {NumberColumn("scan"), NumberColumn("pixel on the part", "mm"),
                  NumberColumn("depth per pixel", "mm"),
                  NumberColumn("angle of sight to laser plane", "\u00b0"),
                  NumberColumn("incidence of camera", "\u00b0"),
                  NumberColumn("incidence of laser", "\u00b0"), NumberColumn("overlap")},
                 rows)};
}

}  // namespace sightline
