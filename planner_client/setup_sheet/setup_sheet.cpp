// SPDX-License-Identifier: Apache-2.0
#include "planner_client/setup_sheet/setup_sheet.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "core/status/status_macros.h"
#include "planner_client/exports/scan_frames.h"
#include "planner_client/setup_sheet/direction_words.h"
#include "planner_client/setup_sheet/scan_blocks.h"
#include "planner_client/setup_sheet/sheet_text.h"
#include "report/document/report_parts.h"
#include "report/page/html.h"
#include "report/page/number_text.h"

namespace sightline {
namespace {

using Steps = std::vector<std::vector<v1::ReportRun>>;

v1::ReportCell LengthCell(double length_m, const std::string& text) {
  return NumberCell(1e3 * length_m, text);
}

v1::ReportCell TimeCell(double seconds) { return NumberCell(seconds, SheetSeconds(seconds), "s"); }

std::string StageRange(const v1::PlannedScan& scan) {
  return absl::StrCat(StageMm(scan.stage_start_m()), " \u2026 ", StageMm(scan.stage_end_m()));
}

const v1::ReportCell& Box() {
  static const v1::ReportCell kBox = TextCell("\u2610");
  return kBox;
}

void Append(const ReportBlocks& more, ReportBlocks* blocks) {
  blocks->insert(blocks->end(), more.begin(), more.end());
}

class Sheet {
 public:
  Sheet(const SetUpSheet& data, std::vector<ScanFrames> frames)
      : data_(data), plan_(data.plan), frames_(std::move(frames)), part_(data.mesh) {}

  v1::Report Report() const {
    const std::string name =
        plan_.inspection_name().empty() ? data_.part_name : plan_.inspection_name();
    v1::Report report;
    report.set_title(absl::StrCat(name, " \u2013 set-up sheet"));
    report.set_kind("set_up_sheet");
    report.set_subject("Sightline \u00b7 set-up sheet");
    report.set_heading(absl::StrCat("Set-up sheet: ", name));
    const Eigen::Vector3d size_m = part_.box_m.sizes();
    *report.add_finding() = PlainRun(Summary());
    ReportBlocks about = {RemarkBlock(absl::StrCat(
        "Part ", data_.part_name, ", ", SheetMm(size_m.x()), " \u00d7 ", SheetMm(size_m.y()),
        " \u00d7 ", SheetMm(size_m.z()), " mm. Sightline ", plan_.sightline_version(),
        ", plan of scene ", plan_.scene_digest().substr(0, 12), "."))};
    if (!plan_.scans().empty()) about.push_back(Conventions());
    if (plan_.has_placement()) about.push_back(HowExactly());
    AddSection(&report, "machine", "Machine axes", about);
    if (plan_.scans().empty()) return report;
    AddSection(&report, "setups", "Set-ups in order", SetupsTable());
    AddSection(&report, "faces", "Faces that the part rests on", RestingFaces());
    AddSection(&report, "scans", "Scans in order", {OverviewTable()});
    for (int s = 0; s < plan_.setups_size(); ++s) AddSetupPage(s, &report);
    if (plan_.setups().empty()) {
      for (int i = 0; i < plan_.scans_size(); ++i) AddScanPage(i, &report);
    }
    return report;
  }

 private:
  SheetScan ScanAt(int i) const {
    const auto at = static_cast<size_t>(i);
    const v1::PlannedScan& scan = plan_.scans(i);
    static const std::string kNoPicture;
    const bool face = scan.has_resting_face() && !data_.face_pictures_png.empty();
    return {plan_,
            scan,
            frames_[at],
            part_,
            data_.pictures_png[at],
            face ? data_.face_pictures_png[static_cast<size_t>(scan.resting_face())] : kNoPicture};
  }

  std::string Sensors() const { return data_.one_housing ? "the sensor head" : "camera and laser"; }

  std::string FaceName(int face) const {
    return absl::StrCat("face ", plan_.resting_faces(face).name());
  }

  std::string Summary() const {
    if (plan_.scans().empty()) return "The plan has no scans.";
    const v1::PlanCost& cost = plan_.cost();
    const std::string times =
        cost.scan_time_s() + cost.reposition_time_s() > 0
            ? absl::StrCat("; ", SheetSeconds(cost.scan_time_s()), " of scanning and ",
                           SheetSeconds(cost.reposition_time_s()), " of set-up")
            : "";
    return absl::StrCat(plan_.scans_size(), plan_.scans_size() == 1 ? " scan" : " scans",
                        ", in this order", times, ". Together they measure ",
                        FixedNumber(100 * plan_.coverage().coverage(), 1),
                        "\u202f% of the measurable surface.");
  }

  static v1::ReportBlock Conventions() {
    return TextBlock(
        "The origin is the point where the camera\u2019s optical axis meets the laser plane. x "
        "is the direction in which the stage carries the part, z is up, y completes a "
        "right-handed system. It moves with the sensors: find it anew, and set stage and "
        "height to 0 there, whenever their place changes. Camera and laser stand still during "
        "a scan. Angles are counter-clockwise when the axis points at you. Azimuth is counted "
        "from +x towards +y, elevation from the horizontal upwards. Stage positions are those "
        "of the part\u2019s centre from the origin along x.");
  }

  // Two standard deviations on either side contain 95 of 100 errors.
  v1::ReportBlock HowExactly() const {
    const v1::Placement& p = plan_.placement();
    const auto within = [](const std::string& name, double position_m, double angle_deg) {
      return TextFact(name, absl::StrCat("\u00b1", SheetMm(2 * position_m, 2), " mm, \u00b1",
                                         SheetDeg(2 * angle_deg, 2)));
    };
    std::vector<v1::ReportFact> facts = {
        within("Part", p.part_position_m(), p.part_angle_deg()),
        within(data_.one_housing ? "Sensor head" : "Camera and laser, each", p.sensor_position_m(),
               p.sensor_angle_deg())};
    if (plan_.coverage().has_placement_p5()) {
      const double percent = 100 * plan_.coverage().placement_p5();
      facts.push_back(NumberFact("Then 95 of 100 executions measure at least", percent, "%",
                                 absl::StrCat(FixedNumber(percent, 1), "\u202f%")));
    }
    return TitledBlock("How exactly to place things (95 of 100)", {FactsBlock(facts)});
  }

  // With unit costs every scan costs 1, and times are undefined.
  bool HasTimes() const { return !plan_.cost().unit_costs(); }

  ReportBlocks SetupsTable() const {
    if (plan_.setups().empty()) return {};
    std::vector<v1::ReportColumn> columns = {NumberColumn("set-up"), WordsColumn("lies on"),
                                             NumberColumn("place of the sensors"),
                                             WordsColumn("scans")};
    if (HasTimes()) {
      for (const char* name : {"moving sensors", "laying", "turning", "scanning", "in all"}) {
        columns.push_back(NumberColumn(name));
      }
    }
    std::vector<ReportCells> rows;
    for (int s = 0; s < plan_.setups_size(); ++s) {
      const v1::Setup& setup = plan_.setups(s);
      const v1::SetupTime& time = setup.time_s();
      ReportCells row = {
          CountCell(s + 1),
          TextCell(setup.has_resting_face() ? FaceName(setup.resting_face()) : kNoValue),
          CountCell(setup.sensor_place() + 1), TextCell(absl::StrJoin(setup.scans(), ", "))};
      for (const double time_s :
           {time.move_sensors(), time.lay(), time.turn(), time.scan(), time.total()}) {
        if (HasTimes()) row.push_back(TimeCell(time_s));
      }
      rows.push_back(std::move(row));
    }
    return {TableBlock("Set-ups in order", columns, rows)};
  }

  ReportBlocks RestingFaces() const {
    if (plan_.resting_faces().empty()) return {};
    std::vector<ReportCells> rows;
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
      const double area_mm2 = 1e6 * face.area_m2();
      rows.push_back(
          {StrongCell(face.name()), TextCell(face.has_normal() ? UnitVectorText(normal) : kNoValue),
           TextCell(face.has_centre_m() ? PlaceMm(centre_m) : kNoValue),
           area_mm2 > 0 ? NumberCell(area_mm2, GroupedInteger(std::llround(area_mm2)))
                        : TextCell(kNoValue),
           face.stability_deg() > 0
               ? NumberCell(face.stability_deg(), SheetDeg(face.stability_deg()), "\u00b0")
               : TextCell(kNoValue),
           TextCell(scans.empty() ? kNoValue : absl::StrJoin(scans, ", "))});
    }
    return {TableBlock(
        "Faces that the part rests on",
        {WordsColumn("face"), WordsColumn("down: outward normal in the CAD file"),
         NumberColumn("its centre in the CAD file", "mm"), NumberColumn("area", "mm\u00b2"),
         NumberColumn("topples after"), WordsColumn("scans")},
        rows)};
  }

  v1::ReportBlock OverviewTable() const {
    const bool faces = !plan_.resting_faces().empty(), timed = plan_.cost().scan_time_s() > 0;
    std::vector<v1::ReportColumn> columns = {NumberColumn("scan")};
    if (faces) columns.push_back(WordsColumn("lies on"));
    for (const v1::ReportColumn& column :
         {NumberColumn("part turned \u03b1 / \u03b2 / \u03b3"), WordsColumn("camera"),
          NumberColumn("triang. angle"), NumberColumn("distance", "mm"),
          NumberColumn("stage", "mm"), NumberColumn("frames")}) {
      columns.push_back(column);
    }
    if (timed) columns.push_back(NumberColumn("time", "s"));
    columns.push_back(NumberColumn("covered so far"));
    columns.push_back(WordsColumn("done"));
    const double measurable =
        std::max<double>(1, static_cast<double>(plan_.coverage().measurable_targets()));
    std::vector<ReportCells> rows;
    for (int i = 0; i < plan_.scans_size(); ++i) {
      const v1::PlannedScan& scan = plan_.scans(i);
      const v1::Measurement& m = scan.measurement();
      const double covered = 100 * static_cast<double>(scan.cumulative_targets()) / measurable;
      ReportCells row = {CountCell(scan.index())};
      if (faces) {
        row.push_back(TextCell(scan.has_resting_face() ? FaceName(scan.resting_face()) : kNoValue));
      }
      for (const v1::ReportCell& cell :
           {TextCell(absl::StrCat(TurnDeg(m.part_alpha_deg()), " / ", TurnDeg(m.part_beta_deg()),
                                  " / ", TurnDeg(m.part_gamma_deg()))),
            TextCell(PlaceInWords(frames_[static_cast<size_t>(i)].camera.translation())),
            NumberCell(m.triangulation_angle_deg(), SheetDeg(m.triangulation_angle_deg()),
                       "\u00b0"),
            LengthCell(m.camera_distance_m(), SheetMm(m.camera_distance_m())),
            TextCell(StageRange(scan)), CountCell(scan.trigger_positions_m_size())}) {
        row.push_back(cell);
      }
      if (timed) row.push_back(NumberCell(scan.scan_time_s(), FixedNumber(scan.scan_time_s(), 1)));
      row.push_back(NumberCell(covered, absl::StrCat(FixedNumber(covered, 1), "\u202f%"), "%"));
      row.push_back(Box());
      rows.push_back(std::move(row));
    }
    return TableBlock("Scans in order", columns, rows);
  }

  // Position of a scan by its number; -1: the plan has no such scan.
  int PositionOf(int index) const {
    for (int i = 0; i < plan_.scans_size(); ++i) {
      if (plan_.scans(i).index() == index) return i;
    }
    return -1;
  }

  // The part lies in scan `i` as in scan `j`.
  bool LiesAlike(int i, int j) const {
    constexpr double kSame_m = 1e-9;
    return frames_[static_cast<size_t>(i)].part.isApprox(frames_[static_cast<size_t>(j)].part,
                                                         kSame_m) &&
           plan_.scans(i).table_height_m() == plan_.scans(j).table_height_m();
  }

  // Steps that a person takes before the scans of a set-up.
  v1::ReportBlock SetupSteps(int s) const {
    const v1::Setup& setup = plan_.setups(s);
    const v1::Setup* before = s > 0 ? &plan_.setups(s - 1) : nullptr;
    Steps steps;
    if (before != nullptr && before->sensor_place() == setup.sensor_place()) {
      steps.push_back({PlainRun(absl::StrCat("Leave ", Sensors(), " where ",
                                             data_.one_housing ? "it is." : "they are."))});
    } else {
      const double move_s = setup.time_s().move_sensors();
      steps.push_back({PlainRun(absl::StrCat("Put ", Sensors(), " in ")),
                       StrongRun(absl::StrCat("place ", setup.sensor_place() + 1)),
                       PlainRun(absl::StrCat(
                           ", by the numbers below",
                           move_s > 0 ? absl::StrCat(" (", SheetSeconds(move_s), ")") : "", "."))});
    }
    bool stays = false;
    if (setup.has_resting_face()) {
      stays = before != nullptr && before->has_resting_face() &&
              before->resting_face() == setup.resting_face();
      steps.push_back({PlainRun(stays ? "Leave the part on " : "Lay the part on "),
                       StrongRun(FaceName(setup.resting_face())),
                       PlainRun(stays ? "." : ", as the pictures and the CAD axes show.")});
    }
    const int first = PositionOf(setup.scans(0));
    const bool untouched = stays && before != nullptr &&
                           LiesAlike(first, PositionOf(before->scans(before->scans_size() - 1)));
    if (untouched) {
      steps.push_back({PlainRun("Do not touch the part: it lies as in the scan before.")});
    }
    if (!untouched || setup.scans_size() > 1) {
      steps.push_back({PlainRun(absl::StrCat(
          untouched ? "For the other scans, turn" : "Turn",
          " and shift the part as the table says: the turn is counter-clockwise seen from above, "
          "from the part lying with no turn (its axes are below). Measure from the part\u2019s "
          "outermost points to the origin, the stage at 0."))});
    }
    if (plan_.has_placement()) {
      steps.push_back({PlainRun(absl::StrCat(
          "Let the stage run on by ", SheetMm(2 * plan_.placement().part_position_m(), 1),
          " mm before the start and behind the stop, with frames, since the part may lie that far "
          "from its place."))});
    }
    v1::ReportBlock list = ListBlock(steps);
    list.mutable_list()->set_numbered(true);
    return TitledBlock("What to do", {list});
  }

  v1::ReportBlock SetupScans(const v1::Setup& setup) const {
    std::vector<v1::ReportColumn> columns = {NumberColumn("scan"), NumberColumn("part turned")};
    if (setup.has_resting_face()) columns.push_back(NumberColumn("table, z", "mm"));
    for (const v1::ReportColumn& column :
         {NumberColumn("outermost points, stage at 0, in x", "mm"), NumberColumn("in y", "mm"),
          NumberColumn("up to z", "mm"), NumberColumn("part\u2019s centre, x / y / z", "mm"),
          NumberColumn("stage", "mm"), NumberColumn("pitch", "mm"), NumberColumn("frames")}) {
      columns.push_back(column);
    }
    if (HasTimes()) columns.push_back(NumberColumn("time", "s"));
    columns.push_back(WordsColumn("done"));
    std::vector<ReportCells> rows;
    for (const int index : setup.scans()) {
      const int i = PositionOf(index);
      const v1::PlannedScan& scan = plan_.scans(i);
      const int count = scan.trigger_positions_m_size();
      const double turn_deg = scan.measurement().part_gamma_deg();
      ReportCells row = {CountCell(index),
                         NumberCell(std::remainder(turn_deg, 360), TurnDeg(turn_deg, 2), "\u00b0")};
      if (setup.has_resting_face()) {
        row.push_back(LengthCell(scan.table_height_m(), SheetMm(scan.table_height_m())));
      }
      const double pitch_m =
          count > 1 ? (scan.stage_end_m() - scan.stage_start_m()) / (count - 1) : 0;
      const Eigen::AlignedBox3d extent = ExtentAtStageZero(part_, frames_[static_cast<size_t>(i)]);
      for (const int axis : {0, 1}) {
        row.push_back(TextCell(
            absl::StrCat(SheetMm(extent.min()[axis]), " \u2026 ", SheetMm(extent.max()[axis]))));
      }
      row.push_back(LengthCell(extent.max().z(), SheetMm(extent.max().z())));
      row.push_back(TextCell(PlaceMm(frames_[static_cast<size_t>(i)].part * part_.box_m.center())));
      row.push_back(TextCell(StageRange(scan)));
      row.push_back(count > 1 ? LengthCell(pitch_m, StageMm(pitch_m)) : TextCell(kNoValue));
      row.push_back(CountCell(count));
      if (HasTimes()) {
        row.push_back(NumberCell(scan.scan_time_s(), FixedNumber(scan.scan_time_s(), 1)));
      }
      row.push_back(Box());
      rows.push_back(std::move(row));
    }
    return TitledBlock("Scans of this set-up", {TableBlock("Scans of this set-up", columns, rows)});
  }

  static void AddPage(v1::Report* report, const std::string& id, const std::string& title,
                      ReportBlocks blocks) {
    AddSection(report, id, title, std::move(blocks));
    report->mutable_sections(report->sections_size() - 1)->set_new_page(true);
  }

  void AddSetupPage(int s, v1::Report* report) const {
    const v1::Setup& setup = plan_.setups(s);
    const int first = PositionOf(setup.scans(0));
    const SheetScan scan = ScanAt(first);
    ReportBlocks blocks = {RemarkBlock(absl::StrCat(
        scan.scan.has_resting_face()
            ? absl::StrCat("Part lies on ", FaceName(scan.scan.resting_face()), "; ", Sensors())
            : absl::StrCat("Part as below; ", Sensors()),
        " in place ", setup.sensor_place() + 1,
        HasTimes() ? absl::StrCat("; ", SheetSeconds(setup.time_s().total())) : "", "."))};
    for (const v1::ReportBlock& block :
         {SetupSteps(s), SheetPictures(scan), SetupScans(setup),
          SheetSensors(scan, data_.one_housing),
          RemarkBlock(absl::StrCat("Pictures, CAD axes and corners are those of scan ",
                                   setup.scans(0), "."))}) {
      blocks.push_back(block);
    }
    ReportBlocks beside = {SheetPartAxes(scan)};
    for (const int index : setup.scans()) {
      const v1::PlannedScan& of_setup = plan_.scans(PositionOf(index));
      ReportBlocks details = SheetRemarks(of_setup);
      Append(SheetDetails(of_setup), &details);
      beside.push_back(TitledBlock(absl::StrCat("Scan ", index), details));
    }
    beside.push_back(SheetCorners(scan));
    blocks.push_back(GroupBlock(v1::ReportGroup::TWO_COLUMNS, beside));
    AddPage(report, absl::StrCat("setup-", s + 1),
            absl::StrCat("Set-up ", s + 1, " of ", plan_.setups_size()), blocks);
  }

  void AddScanPage(int i, v1::Report* report) const {
    const SheetScan of = ScanAt(i);
    const v1::Measurement& m = of.scan.measurement();
    ReportBlocks blocks = {RemarkBlock(
        of.scan.has_resting_face()
            ? absl::StrCat("The part lies on ", FaceName(of.scan.resting_face()), ", turned ",
                           TurnDeg(m.part_gamma_deg()), ".")
            : absl::StrCat("The part is turned ", TurnDeg(m.part_alpha_deg()), " / ",
                           TurnDeg(m.part_beta_deg()), " / ", TurnDeg(m.part_gamma_deg()), "."))};
    Append(SheetRemarks(of.scan), &blocks);
    blocks.push_back(SheetPictures(of));
    blocks.push_back(SheetSensors(of, data_.one_housing));
    ReportBlocks right = {SheetStage(of.scan)};
    Append(SheetDetails(of.scan), &right);
    blocks.push_back(
        GroupBlock(v1::ReportGroup::TWO_COLUMNS,
                   {GroupBlock(v1::ReportGroup::STACK, {SheetPartPlace(of), SheetPartAxes(of)}),
                    GroupBlock(v1::ReportGroup::STACK, right)}));
    blocks.push_back(SheetCorners(of));
    AddPage(report, absl::StrCat("scan-", of.scan.index()),
            absl::StrCat("Scan ", of.scan.index(), " of ", plan_.scans_size()), blocks);
  }

  const SetUpSheet& data_;
  const v1::Plan& plan_;
  std::vector<ScanFrames> frames_;
  SheetPart part_;
};

}  // namespace

absl::StatusOr<v1::Report> SetUpReport(const SetUpSheet& sheet) {
  if (sheet.mesh.positions_m.empty()) {
    return absl::InvalidArgumentError("set-up sheet: the mesh has no vertices");
  }
  if (static_cast<int>(sheet.pictures_png.size()) != sheet.plan.scans_size()) {
    return absl::InvalidArgumentError(
        absl::StrFormat("set-up sheet: there are %d pictures for %d scans",
                        sheet.pictures_png.size(), sheet.plan.scans_size()));
  }
  if (!sheet.face_pictures_png.empty() &&
      static_cast<int>(sheet.face_pictures_png.size()) != sheet.plan.resting_faces_size()) {
    return absl::InvalidArgumentError(
        absl::StrFormat("set-up sheet: there are %d pictures for %d resting faces",
                        sheet.face_pictures_png.size(), sheet.plan.resting_faces_size()));
  }
  std::vector<ScanFrames> frames;
  for (const v1::PlannedScan& scan : sheet.plan.scans()) {
    SIGHTLINE_ASSIGN_OR_RETURN(auto of_scan, FramesOfScan(scan));
    frames.push_back(std::move(of_scan));
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
  return Sheet(sheet, std::move(frames)).Report();
}

}  // namespace sightline
