// SPDX-License-Identifier: Apache-2.0
#include "planner_client/report/plan/sections/scans_section.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "planner_client/report/page/html.h"
#include "planner_client/report/page/number_text.h"
#include "planner_client/report/plan/sections/plan_text.h"
#include "planner_client/report/plan/sections/report_data.h"
#include "planner_client/report/plan/sections/setups_section.h"

namespace sightline {
namespace {

// `judged`: targets that a tolerance binds; 0: the plan is not for uncertainty.
std::string ScanRow(const v1::PlannedScan& scan, const ReportScan& extra, int number,
                    double measurable, double judged, const std::string& setup) {
  const v1::Measurement& m = scan.measurement();
  std::string row = absl::StrCat("<tr class=\"selectable\" data-scan=\"", number,
                                 "\"><td class=\"strong\">", scan.index());
  if (scan.locked()) row += "<span class=\"badge\">locked</span>";
  if (!setup.empty()) absl::StrAppend(&row, "<br><small>", EscapeHtml(setup), "</small>");
  row += "</td><td>";
  if (!extra.rendered_view_png.empty()) {
    absl::StrAppend(&row, "<img class=\"thumb\" alt=\"Scan ", scan.index(),
                    ": part, camera and laser\" src=\"", PngDataUri(extra.rendered_view_png),
                    "\">");
  }
  const auto cell = [&row](const std::string& text, absl::string_view css_class = "") {
    if (css_class.empty()) {
      absl::StrAppend(&row, "</td><td>", text);
    } else {
      absl::StrAppend(&row, "</td><td class=\"", css_class, "\">", text);
    }
  };
  cell(Millimetres(m.camera_distance_m()), "first");
  cell(FixedNumber(m.triangulation_angle_deg(), 2));
  cell(FixedNumber(m.camera_azimuth_deg(), 2));
  cell(FixedNumber(m.camera_polar_deg(), 2));
  cell(FixedNumber(m.part_alpha_deg(), 2), "first");
  cell(FixedNumber(m.part_beta_deg(), 2));
  cell(FixedNumber(m.part_gamma_deg(), 2));
  cell(Millimetres(m.offset_y_m()));
  cell(Millimetres(m.offset_z_m()));
  cell(Millimetres(scan.stage_start_m(), 0), "first");
  cell(Millimetres(scan.stage_end_m(), 0));
  cell(GroupedInteger(scan.trigger_positions_m_size()));
  cell(scan.scan_time_s() > 0 ? FixedNumber(scan.scan_time_s(), 1) : "\u2013");
  cell(GroupedInteger(scan.covered_targets()), "first");
  cell(GroupedInteger(scan.new_targets()));
  cell(Percent(static_cast<double>(scan.cumulative_targets()) / measurable), "strong");
  if (judged > 0) {
    cell(Percent(static_cast<double>(scan.cumulative_admissible_targets()) / judged),
         "first strong");
    cell(Percent(static_cast<double>(scan.cumulative_relaxed_targets()) / judged));
  }
  return row + "</td></tr>\n";
}

}  // namespace

std::string ScansSection(const ReportData& data) {
  if (data.scans.empty()) return PlanSection("scans", "Scans", "<p>The plan has no scans.</p>\n");
  std::string body = absl::StrCat(
      "<p class=\"soft\">Select a row to see the scan in the part above; click a picture to "
      "enlarge it. "
      "Camera distance, triangulation angle \u03c4, azimuth \u03c6 and polar angle \u03b8 place "
      "camera and "
      "laser; \u03b1, \u03b2, \u03b3 turn the part about x, y, z; y and z shift "
      "it.</p>\n",
      ScrollingTable("Scans", "id=\"scan-table\""),
      "\n<thead>\n<tr class=\"groups\"><td></td><td></td>"
      "<th scope=\"colgroup\" colspan=\"4\">Camera and laser</th><th scope=\"colgroup\" "
      "colspan=\"5\">Part</th><th scope=\"colgroup\" colspan=\"4\">Stage</th>"
      "<th scope=\"colgroup\" colspan=\"3\">Targets</th>{{GROUP}}</tr>\n"
      "<tr><th scope=\"col\">scan</th><td></td><th scope=\"col\" "
      "class=\"first\">distance<br>mm</th><th scope=\"col\">\u03c4<br>\u00b0</th>"
      "<th scope=\"col\">\u03c6<br>\u00b0</th><th scope=\"col\">\u03b8<br>\u00b0</th><th "
      "scope=\"col\" class=\"first\">\u03b1<br>\u00b0</th>"
      "<th scope=\"col\">\u03b2<br>\u00b0</th><th scope=\"col\">\u03b3<br>\u00b0</th><th "
      "scope=\"col\">y<br>mm</th><th scope=\"col\">z<br>mm</th>"
      "<th scope=\"col\" class=\"first\">start<br>mm</th><th scope=\"col\">end<br>mm</th><th "
      "scope=\"col\">frames</th><th scope=\"col\">time<br>s</th>"
      "<th scope=\"col\" class=\"first\">measured</th><th scope=\"col\">new</th><th "
      "scope=\"col\">sum</th>{{HEAD}}</tr>\n</thead>\n<tbody>\n");
  const bool uncertain = data.plan.has_uncertainty();
  body = absl::StrReplaceAll(
      body,
      {{"{{GROUP}}",
        uncertain ? "<th scope=\"colgroup\" colspan=\"2\">Known well enough</th>" : ""},
       {"{{HEAD}}",
        uncertain
            ? "<th scope=\"col\" class=\"first\">admissible</th><th scope=\"col\">relaxed</th>"
            : ""}});
  const double judged =
      uncertain ? std::max<double>(1, static_cast<double>(data.plan.uncertainty().judged_targets()))
                : 0;
  const double measurable =
      std::max<double>(1, static_cast<double>(data.plan.coverage().measurable_targets()));
  for (size_t i = 0; i < data.scans.size(); ++i) {
    body += ScanRow(data.plan.scans(static_cast<int>(i)), data.scans[i], static_cast<int>(i) + 1,
                    measurable, judged, SetupText(data.plan, data.plan.scans(static_cast<int>(i))));
  }
  body += "</tbody></table></div>\n";
  if (!data.set_up_sheet.empty()) {
    absl::StrAppend(&body, "<p>To set them up: <a href=\"", EscapeHtml(data.set_up_sheet),
                    "\">set-up sheet</a>, a page to print for every scan.</p>\n");
  }
  return PlanSection("scans", "Scans", body, "long");
}

}  // namespace sightline
