// SPDX-License-Identifier: Apache-2.0
#include "planner_client/report/plan/sections/setups_section.h"

#include <cmath>
#include <cstdint>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "planner_client/report/page/html.h"
#include "planner_client/report/page/number_text.h"
#include "planner_client/report/plan/sections/plan_text.h"

namespace sightline {
std::string SetupText(const v1::Plan& plan, const v1::PlannedScan& scan) {
  if (!scan.has_resting_face() || scan.resting_face() < 0 ||
      scan.resting_face() >= plan.resting_faces_size()) {
    return "";
  }
  return absl::StrCat("lies on face ", plan.resting_faces(scan.resting_face()).name(), ", turned ",
                      FixedNumber(std::remainder(scan.measurement().part_gamma_deg(), 360), 1),
                      "\u00b0; table ", Millimetres(std::abs(scan.table_height_m())), " mm ",
                      scan.table_height_m() <= 0 ? "below" : "above", " the stage axis");
}

namespace {

// Set-ups in their order, with the time of each; nothing where the costs give no times.
std::string SetupTable(const v1::Plan& plan) {
  if (plan.setups().empty() || plan.cost().unit_costs()) return "";
  std::string html = absl::StrCat(
      "<p class=\"soft\">A set-up is a resting face with a place of the sensors. Times are by the "
      "inspection\u2019s costs; scans and set-ups are in the order of least time.</p>\n",
      ScrollingTable("Set-ups in order", "id=\"order-table\""),
      "\n<thead><tr><th scope=\"col\">set-up</th><th scope=\"col\">face</th><th "
      "scope=\"col\">sensors<br>in place</th><th scope=\"col\" class=\"words\">scans</th><th "
      "scope=\"col\">placing the<br>sensors, s</th><th scope=\"col\">laying<br>s</th><th "
      "scope=\"col\">turning<br>s</th><th scope=\"col\">scanning<br>s</th><th "
      "scope=\"col\">in all<br>s</th></tr></thead>\n<tbody>\n");
  for (int s = 0; s < plan.setups_size(); ++s) {
    const v1::Setup& setup = plan.setups(s);
    const bool on_face = setup.has_resting_face() && setup.resting_face() >= 0 &&
                         setup.resting_face() < plan.resting_faces_size();
    absl::StrAppend(&html, "<tr><td class=\"strong\">", s + 1, "</td><td>",
                    on_face ? EscapeHtml(plan.resting_faces(setup.resting_face()).name()) : "",
                    "</td><td>", setup.sensor_place() + 1, "</td><td class=\"words\">",
                    absl::StrJoin(setup.scans(), ", "), "</td>");
    for (const double time_s :
         {setup.time_s().move_sensors(), setup.time_s().lay(), setup.time_s().turn(),
          setup.time_s().scan(), setup.time_s().total()}) {
      absl::StrAppend(&html, "<td>", FixedNumber(time_s, 0), "</td>");
    }
    html += "</tr>\n";
  }
  return html + "</tbody></table></div>\n";
}

// Faces that the part would stand on and that the plan does not use.
std::string ExcludedFaces(const v1::Plan& plan) {
  if (plan.excluded_faces().empty()) return "";
  std::string html = "<ul>\n";
  for (const v1::ExcludedFace& excluded : plan.excluded_faces()) {
    absl::StrAppend(&html, "<li>face ", EscapeHtml(excluded.face().name()),
                    " is not used: ", EscapeHtml(excluded.because()), "</li>\n");
  }
  return html + "</ul>\n";
}

}  // namespace

std::string SetupsHtml(const v1::Plan& plan, const std::vector<std::string>& pictures_png) {
  std::string html = SetupTable(plan) + ExcludedFaces(plan);
  if (plan.resting_faces_size() > 0) {
    absl::StrAppend(
        &html,
        "<p class=\"soft\">The part is laid on the table on one of its faces and turned about the "
        "vertical by \u03b3. Stability is the smallest tilt that topples it. \u03b1 and \u03b2 "
        "bring the face down; its normal is in coordinates of the CAD model. The table\u2019s "
        "height is that of its upper face over the axis of the stage.</p>\n",
        ScrollingTable("Faces that the part rests on", "id=\"setup-table\""),
        "\n<thead><tr><th scope=\"col\">face</th><td></td>"
        "<th scope=\"col\">normal</th><th scope=\"col\">\u03b1<br>\u00b0</th><th "
        "scope=\"col\">\u03b2<br>\u00b0</th>"
        "<th scope=\"col\">stability<br>\u00b0</th><th scope=\"col\">area<br>cm\u00b2</th><th "
        "scope=\"col\">centre over table<br>mm</th>"
        "<th scope=\"col\" class=\"words\">scans</th></tr></thead>\n<tbody>\n");
    for (int f = 0; f < plan.resting_faces_size(); ++f) {
      const v1::RestingFace& face = plan.resting_faces(f);
      std::string picture, scans;
      for (int i = 0; i < plan.scans_size(); ++i) {
        const v1::PlannedScan& scan = plan.scans(i);
        if (!scan.has_resting_face() || scan.resting_face() != f) continue;
        absl::StrAppend(&scans, scans.empty() ? "" : "<br>", "scan ", scan.index(), ": turned ",
                        FixedNumber(std::remainder(scan.measurement().part_gamma_deg(), 360), 1),
                        "\u00b0, table at ", Millimetres(scan.table_height_m()), " mm");
        const auto index = static_cast<size_t>(i);
        if (picture.empty() && index < pictures_png.size()) picture = pictures_png[index];
      }
      absl::StrAppend(
          &html, "<tr><td class=\"strong\">", EscapeHtml(face.name()), "</td><td>",
          picture.empty()
              ? ""
              : absl::StrCat("<img class=\"thumb\" alt=\"The part on face ",
                             EscapeHtml(face.name()), "\" src=\"", PngDataUri(picture), "\">"),
          "</td><td>", FixedNumber(face.normal().x(), 2), ", ", FixedNumber(face.normal().y(), 2),
          ", ", FixedNumber(face.normal().z(), 2), "</td><td>",
          FixedNumber(face.part_alpha_deg(), 2), "</td><td>", FixedNumber(face.part_beta_deg(), 2),
          "</td><td>", face.stability_deg() > 0 ? FixedNumber(face.stability_deg(), 0) : "given",
          "</td><td>", FixedNumber(1e4 * face.area_m2(), 1), "</td><td>",
          Millimetres(face.centre_height_m()), "</td><td class=\"words\">", scans, "</td></tr>\n");
    }
    html += "</tbody></table></div>\n";
  }
  std::string remarks;
  for (const v1::PlannedScan& scan : plan.scans()) {
    for (const std::string& remark : scan.remarks()) {
      absl::StrAppend(&remarks, "<li>scan ", scan.index(), ": ", EscapeHtml(remark), "</li>\n");
    }
  }
  if (!remarks.empty()) absl::StrAppend(&html, "<ul>\n", remarks, "</ul>\n");
  return html;
}

}  // namespace sightline
