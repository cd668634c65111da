// SPDX-License-Identifier: Apache-2.0
#include "planner_client/setup_sheet/setup_sheet.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <unordered_set>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "core/physics/angle.h"
#include "planner_client/exports/scan_frames.h"
#include "planner_client/report/page/html.h"
#include "planner_client/report/page/number_text.h"
#include "planner_client/setup_sheet/direction_words.h"
#include "planner_client/setup_sheet/scene_drawing.h"
#include "planner_client/setup_sheet/sheet_style.h"

namespace sightline {
namespace {

std::string Mm(double length_m, int decimals = 1) { return FixedNumber(1e3 * length_m, decimals); }

// Multiples of the scan step have as many decimals as they need, at most three.
std::string StageMm(double length_m) {
  std::string text = Mm(length_m, 3);
  while (text.back() == '0') text.pop_back();
  if (text.back() == '.') text.pop_back();
  return text;
}

std::string Deg(double angle_deg, int decimals = 1) {
  return absl::StrCat(FixedNumber(angle_deg, decimals), "\u00b0");
}

std::string PlaceMm(const Eigen::Vector3d& place_m) {
  return absl::StrCat(Mm(place_m.x()), " / ", Mm(place_m.y()), " / ", Mm(place_m.z()));
}

std::string UnitVector(const Eigen::Vector3d& v) {
  return absl::StrCat(FixedNumber(v.x(), 4), " / ", FixedNumber(v.y(), 4), " / ",
                      FixedNumber(v.z(), 4));
}

std::string Seconds(double seconds) {
  if (seconds < 120) return absl::StrCat(FixedNumber(seconds, 1), " s");
  const auto whole = static_cast<int64_t>(std::llround(seconds));
  return absl::StrFormat("%d min %02d s", whole / 60, whole % 60);
}

using FactList = std::vector<std::pair<std::string, std::string>>;

// Two columns: what it is, its value; both HTML.
std::string Facts(const std::string& title, const FactList& facts) {
  if (facts.empty()) return "";
  std::string html = title.empty() ? "" : absl::StrCat("<h3>", title, "</h3>\n");
  html += "<table class=\"facts\"><tbody>\n";
  for (const auto& [name, value] : facts) {
    absl::StrAppend(&html, "<tr><th scope=\"row\">", name, "</th><td>", value, "</td></tr>\n");
  }
  return html + "</tbody></table>\n";
}

// Whether an angle is worth a step of a person.
bool Turns(double angle_deg) { return std::abs(std::remainder(angle_deg, 360)) > 0.005; }

// The shorter way round, from -180 to 180 degrees: everywhere on the sheet, so that one turn has
// one number.
std::string Turn(double angle_deg, int decimals = 1) {
  return Deg(std::remainder(angle_deg, 360), decimals);
}

std::string TurnText(double angle_deg, const char* about) {
  return absl::StrCat("<strong>", Turn(angle_deg, 2), "</strong> about ", about);
}

// A vertex for each cell of a grid over the part that holds any: drawings are a few hundred pixels,
// meshes a million vertices.
std::vector<Eigen::Vector3d> ThinnedVertices(const TriangleMesh& mesh) {
  constexpr int64_t kCells = 100;  // along the longest side
  const Eigen::AlignedBox3d box = mesh.BoundingBox();
  const double cell_m = std::max(box.sizes().maxCoeff() / kCells, 1e-9);
  std::unordered_set<int64_t> taken;
  std::vector<Eigen::Vector3d> vertices_m;
  for (const Eigen::Vector3f& vertex : mesh.positions_m) {
    const Eigen::Vector3d vertex_m = vertex.cast<double>();
    const Eigen::Vector3d cell = (vertex_m - box.min()) / cell_m;
    const int64_t key =
        (static_cast<int64_t>(cell.x()) * 2 * kCells + static_cast<int64_t>(cell.y())) * 2 *
            kCells +
        static_cast<int64_t>(cell.z());
    if (taken.insert(key).second) vertices_m.push_back(vertex_m);
  }
  return vertices_m;
}

class Sheet {
 public:
  Sheet(const SetUpSheet& data, std::vector<ScanFrames> frames)
      : data_(data),
        plan_(data.plan),
        frames_(std::move(frames)),
        box_(data.mesh.BoundingBox()),
        drawn_m_(ThinnedVertices(data.mesh)) {}

  std::string Html() const {
    const std::string name =
        plan_.inspection_name().empty() ? data_.part_name : plan_.inspection_name();
    std::string html = absl::StrCat(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
        "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
        "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; img-src data:; "
        "style-src 'unsafe-inline'\">\n<title>",
        EscapeHtml(name), " \u2013 set-up sheet</title>\n<link rel=\"icon\" href=\"data:,\">\n",
        "<style>\n", SheetStyle(), "</style>\n</head>\n<body>\n<main>\n", Overview(name));
    for (int s = 0; s < plan_.setups_size(); ++s) html += SetupPage(s);
    if (plan_.setups().empty()) {
      for (int i = 0; i < plan_.scans_size(); ++i) html += ScanPage(i);
    }
    return html + "</main>\n</body>\n</html>\n";
  }

 private:
  const v1::RestingFace* FaceOf(const v1::PlannedScan& scan) const {
    return scan.has_resting_face() ? &plan_.resting_faces(scan.resting_face()) : nullptr;
  }

  static std::string FaceName(const v1::RestingFace& face) {
    return absl::StrCat("face ", EscapeHtml(face.name()));
  }

  std::string Overview(const std::string& name) const {
    std::string html = absl::StrCat(
        "<h1>Set-up sheet: ", EscapeHtml(name), "</h1>\n<p class=\"soft\">Part ",
        EscapeHtml(data_.part_name), ", ", Mm(box_.sizes().x()), " \u00d7 ", Mm(box_.sizes().y()),
        " \u00d7 ", Mm(box_.sizes().z()), " mm. Sightline ", EscapeHtml(plan_.sightline_version()),
        ", plan of scene ", EscapeHtml(plan_.scene_digest().substr(0, 12)),
        ".</p>\n<p class=\"screen\"><a href=\"report.html\">Report</a> \u00b7 print this page for "
        "the machine: one page for each set-up.</p>\n");
    if (plan_.scans().empty()) return html + "<p>The plan has no scans.</p>\n";
    const double total_s = plan_.cost().scan_time_s() + plan_.cost().reposition_time_s();
    absl::StrAppend(
        &html, "<p><strong>", plan_.scans_size(), plan_.scans_size() == 1 ? " scan" : " scans",
        "</strong>, in this order",
        total_s > 0 ? absl::StrCat("; ", Seconds(plan_.cost().scan_time_s()), " of scanning and ",
                                   Seconds(plan_.cost().reposition_time_s()), " of set-up")
                    : "",
        ". Together they measure ", FixedNumber(100 * plan_.coverage().coverage(), 1),
        "\u202f% of the measurable surface.</p>\n");
    html +=
        "<div class=\"conventions\"><strong>Machine axes.</strong> The origin is the point where "
        "the camera\u2019s optical axis meets the laser plane. x is the direction in which the "
        "stage carries the part, z is up, y completes a right-handed system. Camera and laser "
        "stand still during a scan. Angles are counter-clockwise when the axis points at you. "
        "Azimuth is counted from +x towards +y, elevation from the horizontal upwards. Stage "
        "positions are those of the part\u2019s centre from the origin along x.</div>\n";
    return html + SetupsTable() + RestingFaces() + OverviewTable();
  }

  // With unit costs every scan costs 1, and nothing has a time.
  bool HasTimes() const { return !plan_.cost().unit_costs(); }

  std::string SetupsTable() const {
    if (plan_.setups().empty()) return "";
    const bool timed = HasTimes();
    std::string html = absl::StrCat(
        "<h2 class=\"minor\">Set-ups in order</h2>\n<table><thead><tr><th "
        "scope=\"col\">set-up</th><th scope=\"col\" class=\"words\">lies on</th><th "
        "scope=\"col\">sensors in<br>place</th><th scope=\"col\" class=\"words\">scans</th>",
        timed ? "<th scope=\"col\">sensors</th><th scope=\"col\">laying</th><th "
                "scope=\"col\">turning</th><th scope=\"col\">scanning</th><th "
                "scope=\"col\">in all</th>"
              : "",
        "</tr></thead>\n<tbody>\n");
    for (int s = 0; s < plan_.setups_size(); ++s) {
      const v1::Setup& setup = plan_.setups(s);
      const v1::SetupTime& time = setup.time_s();
      absl::StrAppend(
          &html, "<tr><td><strong>", s + 1, "</strong></td><td class=\"words\">",
          setup.has_resting_face() ? FaceName(plan_.resting_faces(setup.resting_face())) : "\u2013",
          "</td><td>", setup.sensor_place() + 1, "</td><td class=\"words\">",
          absl::StrJoin(setup.scans(), ", "), "</td>");
      for (const double time_s :
           {time.move_sensors(), time.lay(), time.turn(), time.scan(), time.total()}) {
        if (timed) absl::StrAppend(&html, "<td>", Seconds(time_s), "</td>");
      }
      html += "</tr>\n";
    }
    return html + "</tbody></table>\n";
  }

  std::string RestingFaces() const {
    if (plan_.resting_faces().empty()) return "";
    std::string html =
        "<h2 class=\"minor\">Faces that the part rests on</h2>\n<table><thead><tr><th "
        "scope=\"col\" "
        "class=\"words\">face</th>"
        "<th scope=\"col\" class=\"words\">down: outward normal in the CAD file</th><th "
        "scope=\"col\">its centre in the CAD "
        "file<br>mm</th><th scope=\"col\">area<br>mm\u00b2</th><th scope=\"col\">topples "
        "after</th><th scope=\"col\" class=\"words\">scans"
        "</th></tr></thead>\n<tbody>\n";
    for (int f = 0; f < plan_.resting_faces_size(); ++f) {
      const v1::RestingFace& face = plan_.resting_faces(f);
      std::vector<std::string> scans;
      for (const v1::PlannedScan& scan : plan_.scans()) {
        if (scan.has_resting_face() && scan.resting_face() == f) {
          scans.push_back(absl::StrCat(scan.index()));
        }
      }
      const Eigen::Vector3d normal(face.normal().x(), face.normal().y(), face.normal().z());
      const Eigen::Vector3d centre_m(face.centre_m().x(), face.centre_m().y(), face.centre_m().z());
      absl::StrAppend(&html, "<tr><td class=\"words\"><strong>", EscapeHtml(face.name()),
                      "</strong></td><td class=\"words\">",
                      face.has_normal() ? UnitVector(normal) : "\u2013", "</td><td>",
                      face.has_centre_m() ? PlaceMm(centre_m) : "\u2013", "</td><td>",
                      face.area_m2() > 0
                          ? GroupedInteger(static_cast<int64_t>(std::llround(1e6 * face.area_m2())))
                          : "\u2013",
                      "</td><td>", face.stability_deg() > 0 ? Deg(face.stability_deg()) : "\u2013",
                      "</td><td class=\"words\">",
                      scans.empty() ? "\u2013" : absl::StrJoin(scans, ", "), "</td></tr>\n");
    }
    return html + "</tbody></table>\n";
  }

  std::string OverviewTable() const {
    const bool faces = !plan_.resting_faces().empty();
    const bool timed = plan_.cost().scan_time_s() > 0;
    std::string html =
        "<h2 class=\"minor\">Scans in order</h2>\n<table class=\"overview\"><thead><tr><th "
        "scope=\"col\">scan</th>";
    absl::StrAppend(&html, faces ? "<th scope=\"col\" class=\"words\">lies on</th>" : "",
                    "<th scope=\"col\">part turned<br>\u03b1 / \u03b2 / \u03b3</th><th "
                    "scope=\"col\" class=\"words\">camera"
                    "</th><th scope=\"col\">triang.<br>angle</th><th "
                    "scope=\"col\">distance<br>mm</th><th scope=\"col\">stage<br>mm</th>"
                    "<th scope=\"col\">frames</th>",
                    timed ? "<th scope=\"col\">time<br>s</th>" : "",
                    "<th scope=\"col\">covered<br>so far</th>",
                    "<th scope=\"col\" class=\"box\">done</th></tr></thead>\n<tbody>\n");
    const double measurable =
        std::max<double>(1, static_cast<double>(plan_.coverage().measurable_targets()));
    for (int i = 0; i < plan_.scans_size(); ++i) {
      const v1::PlannedScan& scan = plan_.scans(i);
      const v1::Measurement& m = scan.measurement();
      const v1::RestingFace* face = FaceOf(scan);
      absl::StrAppend(&html, "<tr><td><strong>", scan.index(), "</strong></td>");
      if (faces) {
        absl::StrAppend(&html, "<td class=\"words\">", face ? FaceName(*face) : "\u2013", "</td>");
      }
      absl::StrAppend(&html, "<td>", Turn(m.part_alpha_deg()), " / ", Turn(m.part_beta_deg()),
                      " / ", Turn(m.part_gamma_deg()), "</td><td class=\"words direction\">",
                      PlaceInWords(frames_[static_cast<size_t>(i)].camera.translation()),
                      "</td><td>", Deg(m.triangulation_angle_deg()), "</td><td>",
                      Mm(m.camera_distance_m()), "</td><td>", StageMm(scan.stage_start_m()),
                      " \u2026 ", StageMm(scan.stage_end_m()), "</td><td>",
                      GroupedInteger(scan.trigger_positions_m_size()), "</td>");
      if (timed) absl::StrAppend(&html, "<td>", FixedNumber(scan.scan_time_s(), 1), "</td>");
      absl::StrAppend(
          &html, "<td>",
          FixedNumber(100 * static_cast<double>(scan.cumulative_targets()) / measurable, 1),
          "\u202f%</td><td class=\"box\">\u2610</td></tr>\n");
    }
    return html + "</tbody></table>\n";
  }

  // Position of a scan by its number; -1: the plan has no such scan.
  int PositionOf(int index) const {
    for (int i = 0; i < plan_.scans_size(); ++i) {
      if (plan_.scans(i).index() == index) return i;
    }
    return -1;
  }

  // Steps that a person takes before the scans of a set-up.
  std::string SetupSteps(int s) const {
    const v1::Setup& setup = plan_.setups(s);
    const v1::Setup* before = s > 0 ? &plan_.setups(s - 1) : nullptr;
    std::vector<std::string> steps;
    if (before != nullptr && before->sensor_place() == setup.sensor_place()) {
      steps.push_back("Leave camera and laser where they are.");
    } else {
      steps.push_back(
          absl::StrCat("Put camera and laser in <strong>place ", setup.sensor_place() + 1,
                       "</strong>, by the table below",
                       setup.time_s().move_sensors() > 0
                           ? absl::StrCat(" (", Seconds(setup.time_s().move_sensors()), ")")
                           : "",
                       "."));
    }
    if (setup.has_resting_face()) {
      const std::string face = FaceName(plan_.resting_faces(setup.resting_face()));
      const bool stays = before != nullptr && before->has_resting_face() &&
                         before->resting_face() == setup.resting_face();
      steps.push_back(stays ? absl::StrCat("Leave the part on <strong>", face, "</strong>.")
                            : absl::StrCat("Lay the part on <strong>", face,
                                           "</strong>, as the picture and the CAD axes show."));
    }
    steps.push_back(
        "Turn and shift the part for each scan as the table says: the turn is counter-clockwise "
        "seen from above, from the part lying with no turn.");
    std::string html = "<h3>What to do</h3>\n<ol>";
    for (const std::string& step : steps) absl::StrAppend(&html, "<li>", step, "</li>\n");
    return html + "</ol>\n";
  }

  std::string SetupScans(const v1::Setup& setup) const {
    const bool timed = HasTimes();
    std::string html = absl::StrCat(
        "<h3>Scans of this set-up</h3>\n<table class=\"overview\"><thead><tr><th "
        "scope=\"col\">scan</th><th scope=\"col\">part turned</th>",
        setup.has_resting_face() ? "<th scope=\"col\">table, z<br>mm</th>" : "",
        "<th scope=\"col\">part\u2019s centre, stage at 0<br>x / y / z, mm</th><th "
        "scope=\"col\">stage<br>mm</th><th scope=\"col\">pitch<br>mm</th><th "
        "scope=\"col\">frames</th>",
        timed ? "<th scope=\"col\">time<br>s</th>" : "",
        "<th scope=\"col\" class=\"box\">done</th></tr></thead>\n<tbody>\n");
    for (const int index : setup.scans()) {
      const int i = PositionOf(index);
      const v1::PlannedScan& scan = plan_.scans(i);
      const int count = scan.trigger_positions_m_size();
      absl::StrAppend(&html, "<tr><td><strong>", index, "</strong></td><td>",
                      Turn(scan.measurement().part_gamma_deg(), 2), "</td>");
      if (setup.has_resting_face()) {
        absl::StrAppend(&html, "<td>", Mm(scan.table_height_m()), "</td>");
      }
      absl::StrAppend(
          &html, "<td>", PlaceMm(frames_[static_cast<size_t>(i)].part * box_.center()), "</td><td>",
          StageMm(scan.stage_start_m()), " \u2026 ", StageMm(scan.stage_end_m()), "</td><td>",
          count > 1 ? StageMm((scan.stage_end_m() - scan.stage_start_m()) / (count - 1)) : "\u2013",
          "</td><td>", GroupedInteger(count),
          timed ? absl::StrCat("</td><td>", FixedNumber(scan.scan_time_s(), 1)) : "",
          "</td><td class=\"box\">\u2610</td></tr>\n");
    }
    return html + "</tbody></table>\n";
  }

  // Settings, robot, remarks and quality of one scan of a set-up.
  std::string ScanDetails(int i) const {
    const v1::PlannedScan& scan = plan_.scans(i);
    std::string remarks;
    for (const std::string& remark : scan.remarks()) {
      absl::StrAppend(&remarks, "<p class=\"remark\">", EscapeHtml(remark), "</p>\n");
    }
    return absl::StrCat(
        "<section class=\"scan\" id=\"scan-", scan.index(), "\"><h3>Scan ", scan.index(),
        scan.locked() ? " <span class=\"badge\">kept as given</span>" : "", "</h3>\n", remarks,
        Optics(scan), RobotFacts(scan), Quality(scan), "</section>\n");
  }

  std::string SetupPage(int s) const {
    const v1::Setup& setup = plan_.setups(s);
    const int first = PositionOf(setup.scans(0));
    const v1::RestingFace* face = FaceOf(plan_.scans(first));
    std::string html = absl::StrCat(
        "<section class=\"page\" id=\"setup-", s + 1, "\">\n<header><h2>Set-up ", s + 1, " of ",
        plan_.setups_size(), "</h2><p>",
        face != nullptr ? absl::StrCat("part lies on ", FaceName(*face), "; ") : "",
        "sensors in place ", setup.sensor_place() + 1,
        HasTimes() ? absl::StrCat("; ", Seconds(setup.time_s().total())) : "", "</p></header>\n");
    html += SetupSteps(s) + Pictures(first) + SetupScans(setup) + Sensors(first);
    absl::StrAppend(&html, "<p class=\"soft\">Pictures, CAD axes and corners are those of scan ",
                    setup.scans(0), ".</p>\n<div class=\"columns\">\n", PartAxes(first));
    for (const int index : setup.scans()) html += ScanDetails(PositionOf(index));
    html += "</div>\n" + Corners(first);
    return html + "</section>\n";
  }

  std::string ScanPage(int i) const {
    const v1::PlannedScan& scan = plan_.scans(i);
    const v1::RestingFace* face = FaceOf(scan);
    std::string html = absl::StrCat(
        "<section class=\"page\" id=\"scan-", scan.index(), "\">\n<header><h2>Scan ", scan.index(),
        " of ", plan_.scans_size(),
        scan.locked() ? " <span class=\"badge\">kept as given</span>" : "", "</h2><p>",
        face != nullptr ? absl::StrCat("part lies on ", FaceName(*face), ", turned ",
                                       Turn(scan.measurement().part_gamma_deg()))
                        : absl::StrCat("part turned ", Turn(scan.measurement().part_alpha_deg()),
                                       " / ", Turn(scan.measurement().part_beta_deg()), " / ",
                                       Turn(scan.measurement().part_gamma_deg())),
        "</p></header>\n");
    for (const std::string& remark : scan.remarks()) {
      absl::StrAppend(&html, "<p class=\"remark\">", EscapeHtml(remark), "</p>\n");
    }
    html += Pictures(i);
    html += Sensors(i);
    html += "<div class=\"columns\">\n<div>\n";
    html += PartPlace(i) + PartAxes(i);
    html += "</div>\n<div>\n";
    html += Stage(scan) + Optics(scan) + RobotFacts(scan) + Quality(scan);
    html += "</div>\n</div>\n";
    html += Corners(i);
    return html + "</section>\n";
  }

  DrawnScene SceneOf(int i) const {
    const v1::PlannedScan& scan = plan_.scans(i);
    DrawnScene scene{.frames = frames_[static_cast<size_t>(i)], .part_points_m = {}};
    const Eigen::Isometry3d middle =
        scene.frames.PartAt(0.5 * (scan.stage_start_m() + scan.stage_end_m()));
    scene.part_points_m.reserve(drawn_m_.size());
    for (const Eigen::Vector3d& place_m : drawn_m_) {
      scene.part_points_m.push_back(middle * place_m);
    }
    scene.centre_at_start_m = scene.frames.PartAt(scan.stage_start_m()) * box_.center();
    scene.centre_at_end_m = scene.frames.PartAt(scan.stage_end_m()) * box_.center();
    return scene;
  }

  std::string Pictures(int i) const {
    const DrawnScene scene = SceneOf(i);
    const std::string& png = data_.pictures_png[static_cast<size_t>(i)];
    std::string html = absl::StrCat("<div class=\"pictures", png.empty() ? " two" : "", "\">\n");
    if (!png.empty()) {
      absl::StrAppend(&html, "<figure><img alt=\"Part, camera and laser of scan ",
                      plan_.scans(i).index(), "\" src=\"", PngDataUri(png),
                      "\"><figcaption>Middle of the scan; what is measured by then is coloured"
                      "</figcaption></figure>\n");
    }
    absl::StrAppend(&html, "<figure>", SideViewSvg(scene),
                    "<figcaption>Along the laser line: polar angle of the camera, triangulation "
                    "angle, distances to the origin</figcaption></figure>\n<figure>",
                    TopViewSvg(scene),
                    "<figcaption>From above; the way of the part\u2019s centre</figcaption>"
                    "</figure>\n</div>\n");
    return html;
  }

  // How the part gets where it belongs, step by step.
  std::string PartPlace(int i) const {
    const v1::PlannedScan& scan = plan_.scans(i);
    const v1::Measurement& m = scan.measurement();
    const v1::RestingFace* face = FaceOf(scan);
    std::vector<std::string> steps;
    if (face != nullptr) {
      steps.push_back(absl::StrCat("Lay the part on <strong>", FaceName(*face),
                                   "</strong> (on the first page), as if it were set up with no "
                                   "turn: the CAD axes of this sheet show how."));
      if (Turns(m.part_gamma_deg())) {
        steps.push_back(absl::StrCat("Turn it by ", TurnText(m.part_gamma_deg(), "the vertical"),
                                     ", counter-clockwise seen from above."));
      }
    } else {
      steps.push_back("Begin with the CAD axes along the machine\u2019s: x with the stage, z up.");
      if (Turns(m.part_alpha_deg())) {
        steps.push_back(absl::StrCat("Turn by ",
                                     TurnText(m.part_alpha_deg(),
                                              "the machine\u2019s "
                                              "x axis"),
                                     "."));
      }
      if (Turns(m.part_beta_deg())) {
        steps.push_back(absl::StrCat("Turn by ",
                                     TurnText(m.part_beta_deg(),
                                              "the machine\u2019s "
                                              "y axis"),
                                     "."));
      }
      if (Turns(m.part_gamma_deg())) {
        steps.push_back(absl::StrCat("Turn by ", TurnText(m.part_gamma_deg(), "the vertical"),
                                     ", counter-clockwise seen from above."));
      }
    }
    const ScanFrames& frames = frames_[static_cast<size_t>(i)];
    const Eigen::Vector3d centre_m = frames.part * box_.center();
    steps.push_back(
        absl::StrCat("With the stage at 0, the centre of its bounding box is at <strong>",
                     PlaceMm(centre_m), "</strong> mm."));
    std::string html = "<h3>Part</h3>\n<ol>";
    for (const std::string& step : steps) absl::StrAppend(&html, "<li>", step, "</li>\n");
    html += "</ol>\n";
    Eigen::AlignedBox3d extent;
    for (const Eigen::Vector3f& place_m : data_.mesh.positions_m) {
      extent.extend(frames.part * place_m.cast<double>());
    }
    FactList facts;
    if (face != nullptr) {
      facts.push_back({"Upper face of the table, z", Mm(scan.table_height_m()) + " mm"});
    }
    facts.push_back({"Lowest / highest point, z",
                     absl::StrCat(Mm(extent.min().z()), " / ", Mm(extent.max().z()), " mm")});
    facts.push_back({"From y to y",
                     absl::StrCat(Mm(extent.min().y()), " \u2026 ", Mm(extent.max().y()), " mm")});
    facts.push_back({"From x to x, stage at 0",
                     absl::StrCat(Mm(extent.min().x()), " \u2026 ", Mm(extent.max().x()), " mm")});
    return html + Facts("", facts);
  }

  static std::string Stage(const v1::PlannedScan& scan) {
    const int count = scan.trigger_positions_m_size();
    FactList facts = {{"Start", StageMm(scan.stage_start_m()) + " mm"},
                      {"Stop", StageMm(scan.stage_end_m()) + " mm"},
                      {"Travel", StageMm(scan.stage_end_m() - scan.stage_start_m()) + " mm"},
                      {"Triggers", GroupedInteger(count)}};
    if (count > 1) {
      facts.push_back(
          {"Pitch", StageMm((scan.stage_end_m() - scan.stage_start_m()) / (count - 1)) + " mm"});
    }
    if (scan.scan_time_s() > 0) facts.push_back({"Time of the scan", Seconds(scan.scan_time_s())});
    if (scan.reposition_time_s() > 0) {
      facts.push_back({"Set-up before it", Seconds(scan.reposition_time_s())});
    }
    return Facts("Stage", facts);
  }

  static std::string Optics(const v1::PlannedScan& scan) {
    if (!scan.has_setting()) return "";
    const v1::OpticalSetting& setting = scan.setting();
    const auto milliseconds = [](double seconds) {
      return absl::StrCat(Number(1e3 * seconds), " ms");
    };
    FactList facts = {{"f-number", Number(setting.f_number(), 2)},
                      {"Exposure", milliseconds(setting.exposure_time_s())}};
    if (setting.second_exposure_time_s() > 0) {
      facts.push_back({"Second exposure", milliseconds(setting.second_exposure_time_s())});
    }
    facts.push_back({"Focus distance", Mm(setting.focus_distance_m()) + " mm"});
    facts.push_back({"Laser power", absl::StrCat(Number(1e3 * setting.laser_power_w()), " mW")});
    if (setting.sensor_tilt_x_deg() != 0 || setting.sensor_tilt_y_deg() != 0) {
      facts.push_back({"Sensor tilt, about rows / columns",
                       absl::StrCat(Deg(setting.sensor_tilt_x_deg(), 2), " / ",
                                    Deg(setting.sensor_tilt_y_deg(), 2))});
    }
    return Facts("Camera and laser settings", facts);
  }

  static std::string RobotFacts(const v1::PlannedScan& scan) {
    if (!scan.has_robot()) return "";
    const v1::RobotScan& robot = scan.robot();
    if (!robot.reachable()) {
      return absl::StrCat(
          "<h3>Robot</h3>\n<p class=\"remark\">The robot does not reach this scan: ",
          EscapeHtml(robot.because()), "</p>\n");
    }
    const auto joints = [](const auto& positions) {
      std::vector<std::string> texts;
      for (const double position : positions) texts.push_back(FixedNumber(position, 4));
      return absl::StrJoin(texts, " / ");
    };
    FactList facts = {{"Joints at the start, rad or m", joints(robot.start_position())}};
    if (robot.end_position_size() > 0) {
      facts.push_back({"Joints at the stop", joints(robot.end_position())});
    }
    if (robot.move_time_s() > 0) facts.push_back({"Move before it", Seconds(robot.move_time_s())});
    return Facts("Robot", facts);
  }

  std::string Sensors(int i) const {
    const ScanFrames& frames = frames_[static_cast<size_t>(i)];
    const v1::Measurement& m = plan_.scans(i).measurement();
    std::array<std::string, 6> rows;
    for (const Eigen::Isometry3d* pose : {&frames.camera, &frames.laser}) {
      const Eigen::Vector3d place_m = pose->translation();
      const double aside_m = std::hypot(place_m.x(), place_m.y());
      // Straight above has no azimuth.
      const std::string azimuth = aside_m < 1e-6 * place_m.norm()
                                      ? "\u2013"
                                      : Deg(std::atan2(place_m.y(), place_m.x()) * kDegPerRad, 2);
      const std::string elevation = Deg(std::atan2(place_m.z(), aside_m) * kDegPerRad, 2);
      const std::string cells[] = {PlaceInWords(place_m),
                                   PlaceMm(place_m) + " mm",
                                   Mm(place_m.norm()) + " mm",
                                   absl::StrCat(azimuth, ", ", elevation),
                                   UnitVector(pose->linear().col(2)),
                                   UnitVector(pose->linear().col(0))};
      for (size_t row = 0; row < rows.size(); ++row) {
        absl::StrAppend(&rows[row], "<td>", cells[row], "</td>");
      }
    }
    constexpr std::array<const char*, 6> kNames = {
        "Where it is",        "Position x / y / z", "Distance to the origin",
        "Azimuth, elevation", "Looks along",        "Image rows, laser line along"};
    std::string html =
        "<table class=\"sensors\"><thead><tr><td class=\"words\"></td><th scope=\"col\">Camera, by "
        "its entrance "
        "pupil</th><th scope=\"col\">Laser, by its source</th></tr></thead>\n<tbody>\n";
    for (size_t row = 0; row < rows.size(); ++row) {
      absl::StrAppend(&html, "<tr><th scope=\"row\" class=\"words\">", kNames[row], "</th>",
                      rows[row], "</tr>\n");
    }
    absl::StrAppend(&html,
                    "<tr><th scope=\"row\" class=\"words\">Triangulation angle, camera to "
                    "laser</th><td colspan=\"2\">",
                    Deg(m.triangulation_angle_deg(), 2), "</td></tr>\n");
    return html + "</tbody></table>\n";
  }

  // To check that the part is turned as meant.
  std::string PartAxes(int i) const {
    const Eigen::Matrix3d turn = frames_[static_cast<size_t>(i)].part.linear();
    FactList facts;
    for (int axis = 0; axis < 3; ++axis) {
      facts.push_back(
          {absl::StrCat("CAD ", std::string(1, static_cast<char>('x' + axis)), " points"),
           PointsInWords(turn.col(axis))});
    }
    return Facts("Check: the part\u2019s axes", facts);
  }

  static std::string Quality(const v1::PlannedScan& scan) {
    FactList facts;
    if (scan.has_quality()) {
      const v1::ScanQuality& q = scan.quality();
      const auto spread = [](const v1::ScanQuality::Spread& s, double factor, int decimals,
                             const char* unit) {
        return absl::StrCat(FixedNumber(factor * s.median(), decimals), " (",
                            FixedNumber(factor * s.low(), decimals), " \u2026 ",
                            FixedNumber(factor * s.high(), decimals), ")", unit);
      };
      facts = {
          {"Pixel on the part", spread(q.pixel_footprint_m(), 1e3, 3, " mm")},
          {"Depth per pixel", spread(q.depth_per_pixel_m(), 1e3, 3, " mm")},
          {"Camera off the normal", spread(q.camera_incidence_deg(), 1, 0, "\u00b0")},
          {"Laser off the normal", spread(q.laser_incidence_deg(), 1, 0, "\u00b0")},
          {"Also seen by other scans", absl::StrCat(FixedNumber(100 * q.overlap(), 0), "\u202f%")}};
    }
    facts.push_back({"Points", GroupedInteger(scan.measurement_points())});
    facts.push_back(
        {"Targets, of these new", absl::StrCat(GroupedInteger(scan.covered_targets()), ", ",
                                               GroupedInteger(scan.new_targets()))});
    return Facts("What to expect: median (95 of 100)", facts);
  }

  // Corners of the CAD bounding box, in the machine.
  std::string Corners(int i) const {
    const ScanFrames& frames = frames_[static_cast<size_t>(i)];
    std::string html =
        "<h3>Corners of the CAD bounding box, from the machine\u2019s origin, stage at 0</h3>\n"
        "<table><thead><tr><th scope=\"col\" class=\"words\">corner</th><th scope=\"col\">CAD x / "
        "y / z [mm]</th><th scope=\"col\">machine "
        "x / y / z [mm]</th><th scope=\"col\" class=\"words\">corner</th><th scope=\"col\">CAD x / "
        "y / z [mm]</th><th scope=\"col\">machine "
        "x "
        "/ y / z [mm]</th></tr></thead>\n<tbody>\n";
    const auto cells = [&](int corner) {
      const Eigen::Vector3d place_m =
          box_.corner(static_cast<Eigen::AlignedBox3d::CornerType>(corner));
      return absl::StrCat("<td class=\"words\">", corner + 1, "</td><td>", PlaceMm(place_m),
                          "</td><td>", PlaceMm(frames.part * place_m), "</td>");
    };
    for (int row = 0; row < 4; ++row) {
      absl::StrAppend(&html, "<tr>", cells(row), cells(row + 4), "</tr>\n");
    }
    return html + "</tbody></table>\n";
  }

  const SetUpSheet& data_;
  const v1::Plan& plan_;
  std::vector<ScanFrames> frames_;
  Eigen::AlignedBox3d box_;               // part coordinates
  std::vector<Eigen::Vector3d> drawn_m_;  // vertices that drawings are made of
};

}  // namespace

absl::StatusOr<std::string> SetUpSheetHtml(const SetUpSheet& sheet) {
  if (sheet.mesh.positions_m.empty()) {
    return absl::InvalidArgumentError("set-up sheet: the mesh has no vertices");
  }
  if (static_cast<int>(sheet.pictures_png.size()) != sheet.plan.scans_size()) {
    return absl::InvalidArgumentError(
        absl::StrFormat("set-up sheet: there are %d pictures for %d scans",
                        sheet.pictures_png.size(), sheet.plan.scans_size()));
  }
  std::vector<ScanFrames> frames;
  for (const v1::PlannedScan& scan : sheet.plan.scans()) {
    auto of_scan = FramesOfScan(scan);
    if (!of_scan.ok()) return of_scan.status();
    frames.push_back(*std::move(of_scan));
    const int face = scan.resting_face();
    if (scan.has_resting_face() && (face < 0 || face >= sheet.plan.resting_faces_size())) {
      return absl::InvalidArgumentError(
          absl::StrFormat("set-up sheet: scan %d: resting_face is %d, the plan has %d faces",
                          scan.index(), face, sheet.plan.resting_faces_size()));
    }
  }
  for (const v1::Setup& setup : sheet.plan.setups()) {
    const int faces = sheet.plan.resting_faces_size();
    const bool wrong_face =
        setup.has_resting_face() && (setup.resting_face() < 0 || setup.resting_face() >= faces);
    const bool wrong_scan = std::any_of(setup.scans().begin(), setup.scans().end(), [&](int index) {
      return std::none_of(sheet.plan.scans().begin(), sheet.plan.scans().end(),
                          [&](const v1::PlannedScan& scan) { return scan.index() == index; });
    });
    if (setup.scans().empty() || wrong_face || wrong_scan) {
      return absl::InvalidArgumentError(
          "set-up sheet: a set-up names no scan, or a scan or resting face that the plan does not "
          "have");
    }
  }
  return Sheet(sheet, std::move(frames)).Html();
}

}  // namespace sightline
