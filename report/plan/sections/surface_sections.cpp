// SPDX-License-Identifier: Apache-2.0
#include "report/plan/sections/surface_sections.h"

#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "report/page/html.h"
#include "report/plan/sections/plan_text.h"
#include "report/plan/sections/reasons_section.h"
#include "report/plan/sections/report_data.h"
#include "report/plan/surface/uncovered_regions.h"

namespace sightline {
namespace {

// A sentence on unmeasurable targets, if there are any.
std::string UnmeasurableWords(const ReportData& data) {
  const int64_t others = data.plan.coverage().targets() - data.plan.coverage().measurable_targets();
  if (others == 0) return "";
  const std::string reasons = ReasonsOfUnmeasurable(data);
  return absl::StrCat(" The other ", GroupedInteger(others), others == 1 ? " counts" : " count",
                      " neither for a scan nor against it",
                      reasons.empty() ? "." : absl::StrCat(": ", reasons, "."));
}

}  // namespace

ReportBlocks UncoveredBlocks(const ReportData& data, const std::vector<UncoveredRegion>& regions,
                             size_t region_count, int64_t uncovered) {
  if (regions.empty()) return {TextBlock("Nothing: every measurable target is measured.")};
  const Eigen::AlignedBox3d bounds = data.mesh.BoundingBox();
  std::vector<v1::ReportColumn> columns = {NumberColumn("region"),
                                           NumberColumn("targets"),
                                           NumberColumn("of the surface"),
                                           NumberColumn("area", "mm\u00b2"),
                                           NumberColumn("extent", "mm"),
                                           NumberColumn("centre x, y, z", "mm"),
                                           WordsColumn("where")};
  if (!data.reasons.empty()) columns.push_back(WordsColumn("why"));
  std::vector<ReportCells> rows;
  for (const UncoveredRegion& region : regions) {
    const Eigen::Vector3d size = region.bounds_m.sizes();
    const Eigen::Vector3d& centre = region.centroid_m;
    const double area_mm2 = 1e6 * region.area_share * data.health.area_m2();
    ReportCells row = {
        CountCell(static_cast<int64_t>(rows.size()) + 1),
        CountCell(static_cast<int64_t>(region.targets.size())),
        PercentCell(region.area_share, 2),
        NumberCell(area_mm2, GroupedInteger(std::llround(area_mm2))),
        TextCell(absl::StrCat(Millimetres(size.x(), 0), " \u00d7 ", Millimetres(size.y(), 0),
                              " \u00d7 ", Millimetres(size.z(), 0))),
        TextCell(absl::StrCat(Millimetres(centre.x(), 0), ", ", Millimetres(centre.y(), 0), ", ",
                              Millimetres(centre.z(), 0))),
        TextCell(DescribePlace(region, bounds))};
    if (!data.reasons.empty()) row.push_back(TextCell(ReasonsOf(data, region.targets)));
    rows.push_back(std::move(row));
  }
  v1::ReportBlock table = TableBlock("Connected regions that no scan measures", columns, rows);
  for (int i = 0; i < table.table().rows_size(); ++i) {
    ShowUnmeasuredRegion(i, table.mutable_table()->mutable_rows(i));
  }
  return {
      RemarkBlock(absl::StrCat(
          CountText(uncovered, "measurable target"), " in ",
          CountText(static_cast<int64_t>(region_count), "connected region"),
          " are not measured by any scan",
          region_count > regions.size() ? absl::StrCat("; the ", regions.size(), " largest") : "",
          ". Select a row to look at it above.")),
      table};
}

ReportBlocks MeasurabilityBlocks(const ReportData& data) {
  const int64_t targets = data.plan.coverage().targets();
  const int64_t measurable = data.plan.coverage().measurable_targets();
  const int64_t anywhere = data.plan.coverage().measurable_in_free_space_targets();
  const auto share = [&](int64_t part) {
    return Percent(targets > 0 ? static_cast<double>(part) / static_cast<double>(targets) : 0);
  };
  const std::string directions =
      " can be seen and lit from some pair of directions 10\u00b0 to 80\u00b0 apart";
  ReportBlocks blocks = {TextBlock(absl::StrCat(
      GroupedInteger(measurable), " of ", CountText(targets, "target"), " (", share(measurable),
      ")",
      anywhere > 0
          ? absl::StrCat(" can be measured with this rig: as the part may lie, past table and "
                         "obstacles, within domain and limits. ",
                         GroupedInteger(anywhere), " (", share(anywhere), ")", directions,
                         " if the sensors may stand anywhere.")
          : absl::StrCat(directions, "."),
      UnmeasurableWords(data)))};
  if (!data.measurability_png.empty()) {
    blocks.push_back(
        PictureBlock(data.measurability_png, "Measurable surface", "Measurable surface"));
  }
  return blocks;
}

ReportBlocks PartBlocks(const ReportData& data) {
  const v1::PartHealth& health = data.health;
  const Eigen::Vector3d size = data.mesh.BoundingBox().sizes();
  ReportBlocks blocks;
  std::vector<std::vector<v1::ReportRun>> findings;
  for (const std::string& finding : health.findings()) findings.push_back({PlainRun(finding)});
  blocks.push_back(findings.empty() ? TextBlock("The mesh is sound.") : ListBlock(findings));
  blocks.push_back(FactsBlock(
      {TextFact("Size", absl::StrCat(Millimetres(size.x()), " \u00d7 ", Millimetres(size.y()),
                                     " \u00d7 ", Millimetres(size.z()), " mm")),
       NumberFact("Surface", 1e4 * health.area_m2(), "cm\u00b2",
                  absl::StrCat(GroupedInteger(std::llround(1e4 * health.area_m2())), " cm\u00b2")),
       CountFact("Triangles", health.triangle_count()),
       CountFact("Components", health.component_count()),
       CountFact("Open edges", health.open_edge_count()),
       CountFact("Non-manifold edges", health.non_manifold_edge_count()),
       CountFact("Degenerate triangles", health.degenerate_triangle_count()),
       CountFact("Duplicate triangles", health.duplicate_triangle_count()),
       CountFact("Flipped components", health.flipped_component_count())}));
  return blocks;
}

}  // namespace sightline
