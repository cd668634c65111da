// SPDX-License-Identifier: Apache-2.0
#include "report/plan/sections/setups_section.h"

#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "report/page/number_text.h"
#include "report/plan/sections/plan_text.h"

namespace sightline {
namespace {

// Empty if the costs give no times.
ReportBlocks SetupTable(const v1::Plan& plan) {
  if (plan.setups().empty() || plan.cost().unit_costs()) return {};
  std::vector<ReportCells> rows;
  for (int s = 0; s < plan.setups_size(); ++s) {
    const v1::Setup& setup = plan.setups(s);
    const bool on_face = setup.has_resting_face() && setup.resting_face() >= 0 &&
                         setup.resting_face() < plan.resting_faces_size();
    ReportCells row = {
        CountCell(s + 1), TextCell(on_face ? plan.resting_faces(setup.resting_face()).name() : ""),
        CountCell(setup.sensor_place() + 1), TextCell(absl::StrJoin(setup.scans(), ", "))};
    for (const double time_s :
         {setup.time_s().move_sensors(), setup.time_s().lay(), setup.time_s().turn(),
          setup.time_s().scan(), setup.time_s().total()}) {
      row.push_back(FixedCell(time_s, 0));
    }
    rows.push_back(std::move(row));
  }
  return {RemarkBlock("A set-up is a resting face with a place of the sensors. Times are by the "
                      "inspection\u2019s costs; scans and set-ups are in the order of least time."),
          TableBlock("Set-ups in order",
                     {NumberColumn("set-up"), WordsColumn("face"), NumberColumn("sensors in place"),
                      WordsColumn("scans"), NumberColumn("placing the sensors", "s"),
                      NumberColumn("laying", "s"), NumberColumn("turning", "s"),
                      NumberColumn("scanning", "s"), NumberColumn("in all", "s")},
                     rows)};
}

// Possible resting faces that the plan does not use.
ReportBlocks ExcludedFaces(const v1::Plan& plan) {
  std::vector<std::vector<v1::ReportRun>> items;
  for (const v1::ExcludedFace& excluded : plan.excluded_faces()) {
    items.push_back({PlainRun(
        absl::StrCat("face ", excluded.face().name(), " is not used: ", excluded.because()))});
  }
  if (items.empty()) return {};
  return {ListBlock(items)};
}

v1::ReportCell PictureCell(const std::string& png, const std::string& face) {
  v1::ReportCell cell;
  if (png.empty()) return cell;
  cell.mutable_picture()->set_png(png);
  cell.mutable_picture()->set_alternative(absl::StrCat("Face ", face, " from outside"));
  return cell;
}

ReportBlocks FaceTable(const v1::Plan& plan, const std::vector<std::string>& face_pictures_png) {
  if (plan.resting_faces().empty()) return {};
  std::vector<ReportCells> rows;
  for (int f = 0; f < plan.resting_faces_size(); ++f) {
    const v1::RestingFace& face = plan.resting_faces(f);
    std::vector<std::string> scans;
    for (const v1::PlannedScan& scan : plan.scans()) {
      if (!scan.has_resting_face() || scan.resting_face() != f) continue;
      scans.push_back(
          absl::StrCat("scan ", scan.index(), ": turned ",
                       FixedNumber(std::remainder(scan.measurement().part_gamma_deg(), 360), 1),
                       "\u00b0, table at ", Millimetres(scan.table_height_m()), " mm"));
    }
    rows.push_back(
        {StrongCell(face.name()),
         face_pictures_png.empty()
             ? v1::ReportCell()
             : PictureCell(face_pictures_png[static_cast<size_t>(f)], face.name()),
         TextCell(absl::StrCat(FixedNumber(face.normal().x(), 2), ", ",
                               FixedNumber(face.normal().y(), 2), ", ",
                               FixedNumber(face.normal().z(), 2))),
         FixedCell(face.part_alpha_deg(), 2), FixedCell(face.part_beta_deg(), 2),
         face.stability_deg() > 0 ? FixedCell(face.stability_deg(), 0) : TextCell("given"),
         FixedCell(1e4 * face.area_m2(), 1), MillimetreCell(face.centre_height_m()),
         TextCell(absl::StrJoin(scans, "\n"))});
  }
  return {
      RemarkBlock("The part is laid on the table on one of its faces and turned about the vertical "
                  "by \u03b3. Stability is the smallest tilt that topples it. \u03b1 and \u03b2 "
                  "bring the face down; its normal is in coordinates of the CAD model. The "
                  "table\u2019s height is that of its upper face over the axis of the stage."),
      TableBlock("Faces that the part rests on",
                 {WordsColumn("face"), WordsColumn("this side down"), NumberColumn("normal"),
                  NumberColumn("\u03b1", "\u00b0"), NumberColumn("\u03b2", "\u00b0"),
                  NumberColumn("stability", "\u00b0"), NumberColumn("area", "cm\u00b2"),
                  NumberColumn("centre over table", "mm"), WordsColumn("scans")},
                 rows)};
}

ReportBlocks Remarks(const v1::Plan& plan) {
  std::vector<std::vector<v1::ReportRun>> items;
  for (const v1::PlannedScan& scan : plan.scans()) {
    for (const std::string& remark : scan.remarks()) {
      items.push_back({PlainRun(absl::StrCat("scan ", scan.index(), ": ", remark))});
    }
  }
  if (items.empty()) return {};
  return {ListBlock(items)};
}

}  // namespace

ReportBlocks SetupsBlocks(const v1::Plan& plan, const std::vector<std::string>& face_pictures_png) {
  ReportBlocks blocks = SetupTable(plan);
  for (const ReportBlocks& more :
       {ExcludedFaces(plan), FaceTable(plan, face_pictures_png), Remarks(plan)}) {
    blocks.insert(blocks.end(), more.begin(), more.end());
  }
  return blocks;
}

}  // namespace sightline
