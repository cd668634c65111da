// SPDX-License-Identifier: Apache-2.0
#include "planner_client/report/plan/sections/robot_section.h"

#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "planner_client/report/page/html.h"
#include "planner_client/report/page/number_text.h"

namespace sightline {
namespace {

using Json = nlohmann::json;

std::string PositionText(double position, bool rotary) {
  return rotary ? FixedNumber(position * 180 / std::numbers::pi, 1)
                : FixedNumber(1e3 * position, 1);
}

// One position, or from start to end where the scan moves the joint by what the table shows.
std::string JointCell(const v1::RobotScan& scan, int joint, bool rotary) {
  if (joint >= scan.start_position_size() || joint >= scan.end_position_size()) return "\u2013";
  const std::string start = PositionText(scan.start_position(joint), rotary);
  const std::string end = PositionText(scan.end_position(joint), rotary);
  return start == end ? start : absl::StrCat(start, " to ", end);
}

Json Rounded(double value, double scale) { return std::round(value * scale) / scale; }

Json Matrices(const std::vector<Eigen::Isometry3d>& poses) {
  Json list = Json::array();
  for (const Eigen::Isometry3d& pose : poses) {
    Json matrix = Json::array();
    for (int row = 0; row < 4; ++row) {
      // A hundredth of a millimetre is less than the screen shows.
      for (int column = 0; column < 4; ++column) {
        matrix.push_back(Rounded(pose.matrix()(row, column), 1e5));
      }
    }
    list.push_back(std::move(matrix));
  }
  return list;
}

}  // namespace

std::string RobotSection(const v1::Plan& plan, const ReportRobot& robot) {
  int unreached = 0;
  for (const v1::PlannedScan& scan : plan.scans()) unreached += !scan.robot().reachable();
  std::string html = absl::StrCat(
      "<section id=\"robot\" class=\"long\">\n<h2>Robot</h2>\n<p>", EscapeHtml(robot.name),
      " moves ", FixedNumber(plan.robot_move_time_s(), 1),
      " s between scans, by its slowest joint. ",
      unreached == 0 ? "It reaches every scan."
                     : absl::StrCat("<strong>It cannot make ", unreached, " of ", plan.scans_size(),
                                    plan.scans_size() == 1 ? " scan" : " scans", ".</strong>"),
      "</p>\n", ScrollingTable("Joints of the robot at every scan", "class=\"facts\""),
      "\n<thead><tr><th scope=\"col\">scan</th>");
  for (const ReportRobot::Joint& joint : robot.joints) {
    absl::StrAppend(&html, "<th scope=\"col\">", EscapeHtml(joint.name), "<br>",
                    joint.rotary ? "\u00b0" : "mm", "</th>");
  }
  html +=
      "<th scope=\"col\">move<br>s</th><th scope=\"col\" "
      "class=\"words\">remarks</th></tr></thead>\n<tbody>\n";
  for (const v1::PlannedScan& scan : plan.scans()) {
    absl::StrAppend(&html, "<tr class=\"selectable\" data-scan=\"", scan.index(),
                    "\"><td class=\"strong\">", scan.index(), "</td>");
    for (size_t j = 0; j < robot.joints.size(); ++j) {
      absl::StrAppend(&html, "<td>",
                      JointCell(scan.robot(), static_cast<int>(j), robot.joints[j].rotary),
                      "</td>");
    }
    std::string words;
    for (const std::string& remark : scan.remarks()) {
      absl::StrAppend(&words, words.empty() ? "" : "; ", EscapeHtml(remark));
    }
    if (words.empty()) words = EscapeHtml(scan.robot().because());
    absl::StrAppend(
        &html, "<td>",
        scan.robot().reachable() ? FixedNumber(scan.robot().move_time_s(), 1) : "\u2013",
        "</td><td class=\"words\">", words, "</td></tr>\n");
  }
  return html + "</tbody></table></div>\n</section>\n";
}

Json RobotSolidsJson(const ReportRobot& robot) {
  Json list = Json::array();
  for (const ReportSolid& solid : robot.solids) {
    if (!solid.triangles_m.empty()) {
      std::string bytes(reinterpret_cast<const char*>(solid.triangles_m.data()),
                        solid.triangles_m.size() * sizeof(solid.triangles_m[0]));
      list.push_back({{"triangles", absl::Base64Escape(bytes)}});
    } else if (solid.radius_m > 0) {
      list.push_back({{"radius", solid.radius_m}, {"length", solid.length_m}});
    } else {
      list.push_back({{"size", {solid.box_m.x(), solid.box_m.y(), solid.box_m.z()}}});
    }
  }
  return list;
}

Json RobotPosesJson(const ReportRobot::ScanPoses& scan) {
  if (scan.start.empty()) return Json();
  return {{"start", Matrices(scan.start)}, {"end", Matrices(scan.end)}};
}

}  // namespace sightline
