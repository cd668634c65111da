// SPDX-License-Identifier: Apache-2.0
#include "planner_client/report/plan/sections/surface_sections.h"

#include <cmath>
#include <cstdint>
#include <vector>

#include "absl/strings/str_cat.h"
#include "planner_client/report/page/html.h"
#include "planner_client/report/plan/sections/plan_text.h"
#include "planner_client/report/plan/sections/reasons_section.h"
#include "planner_client/report/plan/sections/report_data.h"
#include "planner_client/report/plan/surface/uncovered_regions.h"

namespace sightline {
namespace {

// The targets that are not measurable in words, if there are any.
std::string UnmeasurableWords(const ReportData& data) {
  const int64_t others = data.plan.coverage().targets() - data.plan.coverage().measurable_targets();
  if (others == 0) return "";
  const std::string reasons = ReasonsOfUnmeasurable(data);
  return absl::StrCat(" The other ", GroupedInteger(others), others == 1 ? " counts" : " count",
                      " neither for a scan nor against it",
                      reasons.empty() ? "." : absl::StrCat(": ", reasons, "."));
}

}  // namespace

std::string UncoveredSection(const ReportData& data, const std::vector<UncoveredRegion>& regions,
                             size_t region_count, int64_t uncovered) {
  if (regions.empty()) {
    return PlanSection("uncovered", "What stays unmeasured",
                       "<p>Nothing: every measurable target is measured.</p>\n");
  }
  const Eigen::AlignedBox3d bounds = data.mesh.BoundingBox();
  std::string body = absl::StrCat(
      "<p class=\"soft\">", CountText(uncovered, "measurable target"), " in ",
      CountText(static_cast<int64_t>(region_count), "connected region"),
      " are not measured by any scan",
      region_count > regions.size() ? absl::StrCat("; the ", regions.size(), " largest") : "",
      ". Select a row to look at it above.</p>\n",
      ScrollingTable("Connected regions that no scan measures", "id=\"region-table\""),
      "\n<thead><tr><th scope=\"col\">region</th><th scope=\"col\">targets</th>"
      "<th scope=\"col\">of the surface</th><th scope=\"col\">area<br>mm\u00b2</th><th "
      "scope=\"col\">extent<br>mm</th><th scope=\"col\">centre x, y, "
      "z<br>mm</th>"
      "<th scope=\"col\" class=\"words\">where</th>",
      data.reasons.empty() ? "" : "<th scope=\"col\" class=\"words\">why</th>",
      "</tr></thead>\n<tbody>\n");
  for (size_t i = 0; i < regions.size(); ++i) {
    const UncoveredRegion& region = regions[i];
    const Eigen::Vector3d size = region.bounds_m.sizes();
    absl::StrAppend(
        &body, "<tr class=\"selectable\" data-region=\"", i, "\"><td class=\"strong\">", i + 1,
        "</td><td>", GroupedInteger(static_cast<int64_t>(region.targets.size())), "</td><td>",
        Percent(region.area_share, 2), "</td><td>",
        GroupedInteger(std::llround(1e6 * region.area_share * data.health.area_m2())), "</td><td>",
        Millimetres(size.x(), 0), " \u00d7 ", Millimetres(size.y(), 0), " \u00d7 ",
        Millimetres(size.z(), 0), "</td><td>", Millimetres(region.centroid_m.x(), 0), ", ",
        Millimetres(region.centroid_m.y(), 0), ", ", Millimetres(region.centroid_m.z(), 0),
        "</td><td class=\"words\">", DescribePlace(region, bounds),
        data.reasons.empty()
            ? ""
            : absl::StrCat("</td><td class=\"words\">", ReasonsOf(data, region.targets)),
        "</td></tr>\n");
  }
  body += "</tbody></table></div>\n";
  return PlanSection("uncovered", "What stays unmeasured", body, "long");
}

std::string MeasurabilitySection(const ReportData& data) {
  const int64_t targets = data.plan.coverage().targets();
  const int64_t measurable = data.plan.coverage().measurable_targets();
  const int64_t anywhere = data.plan.coverage().measurable_in_free_space_targets();
  const auto share = [&](int64_t part) {
    return Percent(targets > 0 ? static_cast<double>(part) / static_cast<double>(targets) : 0);
  };
  const std::string directions =
      " can be seen and lit from some pair of directions 10\u00b0 to 80\u00b0 apart";
  std::string body = absl::StrCat(
      "<p>", GroupedInteger(measurable), " of ", CountText(targets, "target"), " (",
      share(measurable), ")",
      anywhere > 0
          ? absl::StrCat(" can be measured with this rig: as the part may lie, past table and "
                         "obstacles, within domain and limits. ",
                         GroupedInteger(anywhere), " (", share(anywhere), ")", directions,
                         " if the sensors may stand anywhere.")
          : absl::StrCat(directions, "."),
      UnmeasurableWords(data), "</p>\n<div class=\"pictures\">",
      PictureFigure(data.measurability_png, "Measurable surface"), "</div>\n");
  return PlanSection("measurability", "What can be measured at all", body);
}

std::string PartSection(const ReportData& data) {
  const v1::PartHealth& health = data.health;
  const Eigen::Vector3d size = data.mesh.BoundingBox().sizes();
  std::string body;
  if (health.findings().empty()) {
    body += "<p>The mesh is sound.</p>\n";
  } else {
    body += "<ul>";
    for (const std::string& finding : health.findings()) {
      absl::StrAppend(&body, "<li>", EscapeHtml(finding), "</li>");
    }
    body += "</ul>\n";
  }
  body += FactsTable(
      {{"Size", absl::StrCat(Millimetres(size.x()), " \u00d7 ", Millimetres(size.y()), " \u00d7 ",
                             Millimetres(size.z()), " mm")},
       {"Surface", absl::StrCat(GroupedInteger(std::llround(1e4 * health.area_m2())), " cm\u00b2")},
       {"Triangles", GroupedInteger(health.triangle_count())},
       {"Components", GroupedInteger(health.component_count())},
       {"Open edges", GroupedInteger(health.open_edge_count())},
       {"Non-manifold edges", GroupedInteger(health.non_manifold_edge_count())},
       {"Degenerate triangles", GroupedInteger(health.degenerate_triangle_count())},
       {"Duplicate triangles", GroupedInteger(health.duplicate_triangle_count())},
       {"Flipped components", GroupedInteger(health.flipped_component_count())}});
  return PlanSection("part", "Part", body);
}

}  // namespace sightline
