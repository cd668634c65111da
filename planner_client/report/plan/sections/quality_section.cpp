// SPDX-License-Identifier: Apache-2.0
#include "planner_client/report/plan/sections/quality_section.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "planner_client/report/page/html.h"
#include "planner_client/report/page/number_text.h"

namespace sightline {
namespace {

// "0.163 (0.150 … 0.181)".
std::string SpreadCell(const v1::ScanQuality::Spread& spread, double factor, int decimals) {
  return absl::StrCat(
      "<td class=\"first\"><strong>", FixedNumber(factor * spread.median(), decimals),
      "</strong> <span class=\"soft\">", FixedNumber(factor * spread.low(), decimals), " \u2026 ",
      FixedNumber(factor * spread.high(), decimals), "</span></td>");
}

}  // namespace

std::string QualitySection(const v1::Plan& plan) {
  const bool any = std::any_of(plan.scans().begin(), plan.scans().end(),
                               [](const v1::PlannedScan& scan) { return scan.has_quality(); });
  if (!any) return "";
  std::string html = absl::StrCat(
      "<section id=\"quality\" class=\"long\">\n<h2>How finely each scan measures</h2>\n"
      "<p class=\"soft\">Over all points of a scan: the median, and the limits between which 95 of "
      "100 lie. Depth per pixel is the pixel\u2019s size on the part over the sine of the angle "
      "between line of sight and laser plane; incidence is counted from the surface\u2019s normal; "
      "overlap is the part of a scan\u2019s targets that others measure as "
      "well.</p>\n",
      ScrollingTable("How finely each scan measures"),
      "\n<thead><tr><th scope=\"col\">scan</th><th scope=\"col\" class=\"first\">pixel on the "
      "part<br>mm</th><th scope=\"col\" class=\"first\">depth per pixel<br>mm</th><th "
      "scope=\"col\" class=\"first\">angle of "
      "sight to laser plane<br>\u00b0</th><th scope=\"col\" class=\"first\">incidence of "
      "camera<br>\u00b0</th>"
      "<th scope=\"col\" class=\"first\">incidence of laser<br>\u00b0</th><th scope=\"col\" "
      "class=\"first\">overlap</th></tr>"
      "</thead>\n<tbody>\n");
  for (const v1::PlannedScan& scan : plan.scans()) {
    absl::StrAppend(&html, "<tr><td class=\"strong\">", scan.index(), "</td>");
    if (!scan.has_quality()) {
      html += "<td class=\"first\" colspan=\"6\">measures nothing</td></tr>\n";
      continue;
    }
    const v1::ScanQuality& quality = scan.quality();
    absl::StrAppend(&html, SpreadCell(quality.pixel_footprint_m(), 1e3, 3),
                    SpreadCell(quality.depth_per_pixel_m(), 1e3, 3),
                    SpreadCell(quality.triangulation_angle_deg(), 1, 1),
                    SpreadCell(quality.camera_incidence_deg(), 1, 0),
                    SpreadCell(quality.laser_incidence_deg(), 1, 0), "<td class=\"first\">",
                    FixedNumber(100 * quality.overlap(), 0), "\u202f%</td></tr>\n");
  }
  return html + "</tbody></table></div>\n</section>\n";
}

}  // namespace sightline
