// SPDX-License-Identifier: Apache-2.0
#include "planner_client/setup_sheet/scan_blocks.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <unordered_set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "core/physics/angle.h"
#include "planner_client/setup_sheet/direction_words.h"
#include "planner_client/setup_sheet/scene_drawing.h"
#include "planner_client/setup_sheet/sheet_text.h"
#include "report/page/html.h"
#include "report/page/number_text.h"

namespace sightline {
namespace {

using Steps = std::vector<std::vector<v1::ReportRun>>;

// True if an angle is large enough to be a step for a person.
bool Turns(double angle_deg) { return std::abs(std::remainder(angle_deg, 360)) > 0.005; }

v1::ReportFact LengthFact(const std::string& name, double length_m) {
  return NumberFact(name, 1e3 * length_m, "mm", absl::StrCat(StageMm(length_m), " mm"));
}

v1::ReportFact TimeFact(const std::string& name, double seconds) {
  return NumberFact(name, seconds, "s", SheetSeconds(seconds));
}

// Drawings are a few hundred pixels, meshes a million vertices.
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

DrawnScene SceneOf(const SheetScan& of) {
  DrawnScene scene{.frames = of.frames, .part_points_m = {}};
  const double start_m = of.scan.stage_start_m(), end_m = of.scan.stage_end_m();
  const Eigen::Isometry3d middle = of.frames.PartAt(0.5 * (start_m + end_m));
  for (const Eigen::Vector3d& place_m : of.part.drawn_m) {
    scene.part_points_m.push_back(middle * place_m);
  }
  scene.centre_at_start_m = of.frames.PartAt(start_m) * of.part.box_m.center();
  scene.centre_at_end_m = of.frames.PartAt(end_m) * of.part.box_m.center();
  return scene;
}

std::vector<v1::ReportRun> TurnStep(const std::string& begin, double angle_deg,
                                    const std::string& end) {
  return {PlainRun(begin), StrongRun(TurnDeg(angle_deg, 2)), PlainRun(end)};
}

Steps StepsOfPart(const SheetScan& of) {
  const v1::Measurement& m = of.scan.measurement();
  Steps steps;
  if (of.scan.has_resting_face()) {
    steps.push_back(
        {PlainRun("Lay the part on "),
         StrongRun(absl::StrCat("face ", of.plan.resting_faces(of.scan.resting_face()).name())),
         PlainRun(" (on the first page), as if it were set up with no turn: the CAD axes of this "
                  "sheet show how.")});
  } else {
    steps.push_back(
        {PlainRun("Begin with the CAD axes along the machine\u2019s: x with the stage, z up.")});
    if (Turns(m.part_alpha_deg())) {
      steps.push_back(
          TurnStep("Turn by ", m.part_alpha_deg(), " about the machine\u2019s x axis."));
    }
    if (Turns(m.part_beta_deg())) {
      steps.push_back(TurnStep("Turn by ", m.part_beta_deg(), " about the machine\u2019s y axis."));
    }
  }
  if (Turns(m.part_gamma_deg())) {
    steps.push_back(TurnStep("Turn it by ", m.part_gamma_deg(),
                             " about the vertical, counter-clockwise seen from above."));
  }
  steps.push_back({PlainRun("With the stage at 0, the centre of its bounding box is at "),
                   StrongRun(PlaceMm(of.frames.part * of.part.box_m.center())), PlainRun(" mm.")});
  return steps;
}

v1::ReportBlock StepsBlock(const Steps& steps) {
  v1::ReportBlock block = ListBlock(steps);
  block.mutable_list()->set_numbered(true);
  return block;
}

v1::ReportBlock Settings(const v1::OpticalSetting& setting) {
  const auto exposure = [](const std::string& name, double seconds) {
    return NumberFact(name, seconds, "s", absl::StrCat(Number(1e3 * seconds), " ms"));
  };
  std::vector<v1::ReportFact> facts = {
      NumberFact("f-number", setting.f_number(), "", Number(setting.f_number(), 2)),
      exposure("Exposure", setting.exposure_time_s())};
  if (setting.second_exposure_time_s() > 0) {
    facts.push_back(exposure("Second exposure", setting.second_exposure_time_s()));
  }
  facts.push_back(NumberFact("Focus distance", 1e3 * setting.focus_distance_m(), "mm",
                             absl::StrCat(SheetMm(setting.focus_distance_m()), " mm")));
  facts.push_back(NumberFact("Laser power", setting.laser_power_w(), "W",
                             absl::StrCat(Number(1e3 * setting.laser_power_w()), " mW")));
  if (setting.sensor_tilt_x_deg() != 0 || setting.sensor_tilt_y_deg() != 0) {
    facts.push_back(TextFact("Sensor tilt, about rows / columns",
                             absl::StrCat(SheetDeg(setting.sensor_tilt_x_deg(), 2), " / ",
                                          SheetDeg(setting.sensor_tilt_y_deg(), 2))));
  }
  return TitledBlock("Camera and laser settings", {FactsBlock(facts)});
}

v1::ReportBlock Robot(const v1::RobotScan& robot) {
  if (!robot.reachable()) {
    v1::ReportBlock note;
    note.mutable_note()->set_severity(v1::REPORT_STATE_WARNING);
    note.mutable_note()->set_text(
        absl::StrCat("The robot does not reach this scan: ", robot.because()));
    return TitledBlock("Robot", {note});
  }
  const auto joints = [](const auto& positions) {
    std::vector<std::string> texts;
    for (const double position : positions) texts.push_back(FixedNumber(position, 4));
    return absl::StrJoin(texts, " / ");
  };
  std::vector<v1::ReportFact> facts = {
      TextFact("Joints at the start, rad or m", joints(robot.start_position()))};
  if (robot.end_position_size() > 0) {
    facts.push_back(TextFact("Joints at the stop", joints(robot.end_position())));
  }
  if (robot.move_time_s() > 0) facts.push_back(TimeFact("Move before it", robot.move_time_s()));
  return TitledBlock("Robot", {FactsBlock(facts)});
}

v1::ReportBlock Expectation(const v1::PlannedScan& scan) {
  std::vector<v1::ReportFact> facts;
  if (scan.has_quality()) {
    const v1::ScanQuality& q = scan.quality();
    const auto spread = [](const std::string& name, const v1::ScanQuality::Spread& s, double factor,
                           int decimals, const std::string& unit) {
      return NumberFact(name, factor * s.median(), unit,
                        absl::StrCat(FixedNumber(factor * s.median(), decimals), " (",
                                     FixedNumber(factor * s.low(), decimals), " \u2026 ",
                                     FixedNumber(factor * s.high(), decimals), ") ", unit));
    };
    facts = {spread("Pixel on the part", q.pixel_footprint_m(), 1e3, 3, "mm"),
             spread("Depth per pixel", q.depth_per_pixel_m(), 1e3, 3, "mm"),
             spread("Camera off the normal", q.camera_incidence_deg(), 1, 0, "\u00b0"),
             spread("Laser off the normal", q.laser_incidence_deg(), 1, 0, "\u00b0"),
             NumberFact("Also seen by other scans", 100 * q.overlap(), "%",
                        absl::StrCat(FixedNumber(100 * q.overlap(), 0), "\u202f%"))};
  }
  facts.push_back(CountFact("Points", scan.measurement_points()));
  facts.push_back(CountFact("Targets", scan.covered_targets(),
                            absl::StrCat("of these new: ", GroupedInteger(scan.new_targets()))));
  return TitledBlock("What to expect: median (95 of 100)", {FactsBlock(facts)});
}

}  // namespace

SheetPart::SheetPart(const TriangleMesh& part_mesh)
    : mesh(part_mesh), box_m(part_mesh.BoundingBox()), drawn_m(ThinnedVertices(part_mesh)) {}

ReportBlocks SheetRemarks(const v1::PlannedScan& scan) {
  ReportBlocks blocks;
  if (scan.locked()) blocks.push_back(RemarkBlock("This scan is kept as given."));
  for (const std::string& remark : scan.remarks()) {
    v1::ReportNote& note = *blocks.emplace_back().mutable_note();
    note.set_severity(v1::REPORT_STATE_WARNING);
    note.set_text(remark);
  }
  return blocks;
}

v1::ReportBlock SheetPictures(const SheetScan& of) {
  const DrawnScene scene = SceneOf(of);
  ReportBlocks pictures;
  if (!of.picture_png.empty()) {
    pictures.push_back(
        PictureBlock(of.picture_png,
                     "The part as it lies, z up, in the middle of the scan; what is measured by "
                     "then is coloured",
                     absl::StrCat("Part, camera and laser of scan ", of.scan.index())));
  }
  if (!of.face_png.empty()) {
    const std::string& name = of.plan.resting_faces(of.scan.resting_face()).name();
    pictures.push_back(
        PictureBlock(of.face_png, absl::StrCat("This side goes down: face ", name, " from outside"),
                     absl::StrCat("Face ", name)));
  }
  *pictures.emplace_back().mutable_drawing() = SideView(scene);
  *pictures.emplace_back().mutable_drawing() = TopView(scene);
  return GroupBlock(
      pictures.size() == 3 ? v1::ReportGroup::THREE_COLUMNS : v1::ReportGroup::TWO_COLUMNS,
      pictures);
}

Eigen::AlignedBox3d ExtentAtStageZero(const SheetPart& part, const ScanFrames& frames) {
  Eigen::AlignedBox3d extent;
  for (const Eigen::Vector3f& place_m : part.mesh.positions_m) {
    extent.extend(frames.part * place_m.cast<double>());
  }
  return extent;
}

v1::ReportBlock SheetPartPlace(const SheetScan& of) {
  const Eigen::AlignedBox3d extent = ExtentAtStageZero(of.part, of.frames);
  const auto range = [&](int axis, const char* between) {
    return absl::StrCat(SheetMm(extent.min()[axis]), between, SheetMm(extent.max()[axis]), " mm");
  };
  std::vector<v1::ReportFact> facts;
  if (of.scan.has_resting_face()) {
    facts.push_back(NumberFact("Upper face of the table, z", 1e3 * of.scan.table_height_m(), "mm",
                               absl::StrCat(SheetMm(of.scan.table_height_m()), " mm")));
  }
  facts.push_back(TextFact("Lowest / highest point, z", range(2, " / ")));
  facts.push_back(TextFact("From y to y", range(1, " \u2026 ")));
  facts.push_back(TextFact("From x to x, stage at 0", range(0, " \u2026 ")));
  return TitledBlock("Part", {StepsBlock(StepsOfPart(of)), FactsBlock(facts)});
}

v1::ReportBlock SheetPartAxes(const SheetScan& of) {
  const Eigen::Matrix3d turned = of.frames.part.linear();
  const double gamma_rad = of.scan.measurement().part_gamma_deg() / kDegPerRad;
  const Eigen::Matrix3d not_turned =
      Eigen::AngleAxisd(-gamma_rad, Eigen::Vector3d::UnitZ()) * turned;
  std::vector<ReportCells> rows;
  for (int axis = 0; axis < 3; ++axis) {
    rows.push_back({TextCell(absl::StrCat("CAD ", std::string(1, static_cast<char>('x' + axis)))),
                    TextCell(PointsInWords(not_turned.col(axis))),
                    TextCell(PointsInWords(turned.col(axis)))});
  }
  const std::string turn = TurnDeg(of.scan.measurement().part_gamma_deg(), 2);
  return TitledBlock("Check: where the part\u2019s axes point",
                     {TableBlock("Where the part\u2019s axes point",
                                 {WordsColumn("axis"), WordsColumn("with no turn"),
                                  WordsColumn(absl::StrCat("turned ", turn))},
                                 rows)});
}

v1::ReportBlock SheetCorners(const SheetScan& of) {
  const auto cells = [&](int corner) {
    const Eigen::Vector3d place_m =
        of.part.box_m.corner(static_cast<Eigen::AlignedBox3d::CornerType>(corner));
    return ReportCells{CountCell(corner + 1), TextCell(PlaceMm(place_m)),
                       TextCell(PlaceMm(of.frames.part * place_m))};
  };
  std::vector<ReportCells> rows;
  for (int corner = 0; corner < 8; ++corner) rows.push_back(cells(corner));
  return TitledBlock("Corners of the CAD bounding box, from the machine\u2019s origin, stage at 0",
                     {TableBlock("Corners of the CAD bounding box",
                                 {NumberColumn("corner"), NumberColumn("CAD x / y / z", "mm"),
                                  NumberColumn("machine x / y / z", "mm")},
                                 rows)});
}

namespace {

// Numbers that a person sets on the housing's mount.
v1::ReportBlock HousingFacts(const SheetScan& of) {
  const Eigen::Vector3d laser_m = of.frames.laser.translation();
  const Eigen::Vector3d to_camera_m = of.frames.camera.translation() - laser_m;
  return FactsBlock({NumberFact("Stand-off, laser to the origin", 1e3 * laser_m.norm(), "mm",
                                absl::StrCat(SheetMm(laser_m.norm()), " mm")),
                     TextFact("Laser stands", PlaceInWords(laser_m)),
                     TextFact("Laser line along", PointsInWords(of.frames.laser.linear().col(0))),
                     TextFact("Camera\u2019s side of the housing", PointsInWords(to_camera_m))});
}

}  // namespace

v1::ReportBlock SheetSensors(const SheetScan& of, bool one_housing) {
  std::vector<ReportCells> rows;
  for (const char* name : {"Where it is", "Position x / y / z", "Distance to the origin",
                           "Azimuth, elevation", "Looks along", "Image rows, laser line along"}) {
    rows.push_back({TextCell(name)});
  }
  for (const Eigen::Isometry3d* pose : {&of.frames.camera, &of.frames.laser}) {
    const Eigen::Vector3d place_m = pose->translation();
    const double aside_m = std::hypot(place_m.x(), place_m.y());
    // Straight above has no azimuth.
    const std::string azimuth =
        aside_m < 1e-6 * place_m.norm()
            ? kNoValue
            : SheetDeg(std::atan2(place_m.y(), place_m.x()) * kDegPerRad, 2);
    const std::string elevation = SheetDeg(std::atan2(place_m.z(), aside_m) * kDegPerRad, 2);
    rows[0].push_back(TextCell(PlaceInWords(place_m)));
    rows[1].push_back(TextCell(absl::StrCat(PlaceMm(place_m), " mm")));
    rows[2].push_back(
        NumberCell(1e3 * place_m.norm(), absl::StrCat(SheetMm(place_m.norm()), " mm"), "mm"));
    rows[3].push_back(TextCell(absl::StrCat(azimuth, ", ", elevation)));
    rows[4].push_back(TextCell(UnitVectorText(pose->linear().col(2))));
    rows[5].push_back(TextCell(UnitVectorText(pose->linear().col(0))));
  }
  const double angle_deg = of.scan.measurement().triangulation_angle_deg();
  const v1::ReportBlock angle = FactsBlock({NumberFact(
      "Triangulation angle, camera to laser", angle_deg, "\u00b0", SheetDeg(angle_deg, 2))});
  const v1::ReportBlock places =
      TableBlock("Where camera and laser stand",
                 {WordsColumn(""), WordsColumn("Camera, by its entrance pupil"),
                  WordsColumn("Laser, by its source")},
                 rows);
  if (!one_housing) return TitledBlock("Sensors", {places, angle});
  return TitledBlock("Sensor head",
                     {HousingFacts(of), TitledBlock("Its camera and laser", {places, angle})});
}

v1::ReportBlock SheetStage(const v1::PlannedScan& scan) {
  const int count = scan.trigger_positions_m_size();
  const double travel_m = scan.stage_end_m() - scan.stage_start_m();
  std::vector<v1::ReportFact> facts = {
      LengthFact("Start", scan.stage_start_m()), LengthFact("Stop", scan.stage_end_m()),
      LengthFact("Travel", travel_m), CountFact("Triggers", count)};
  if (count > 1) facts.push_back(LengthFact("Pitch", travel_m / (count - 1)));
  if (scan.scan_time_s() > 0) facts.push_back(TimeFact("Time of the scan", scan.scan_time_s()));
  if (scan.reposition_time_s() > 0) {
    facts.push_back(TimeFact("Set-up before it", scan.reposition_time_s()));
  }
  return TitledBlock("Stage", {FactsBlock(facts)});
}

ReportBlocks SheetDetails(const v1::PlannedScan& scan) {
  ReportBlocks blocks;
  if (scan.has_setting()) blocks.push_back(Settings(scan.setting()));
  if (scan.has_robot()) blocks.push_back(Robot(scan.robot()));
  blocks.push_back(Expectation(scan));
  return blocks;
}

}  // namespace sightline
