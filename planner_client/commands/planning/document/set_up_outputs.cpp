// SPDX-License-Identifier: Apache-2.0
#include "planner_client/commands/planning/document/set_up_outputs.h"

#include <optional>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/file/atomic_write.h"
#include "core/parallel/for_each_index.h"
#include "core/physics/angle.h"
#include "core/status/status_macros.h"
#include "planner_client/command_line/process/output_folder.h"
#include "planner_client/exports/export_files.h"
#include "planner_client/scan_quality/scan_quality.h"
#include "planner_client/setup_sheet/setup_sheet.h"
#include "report/document/report_page.h"

namespace sightline {
namespace {

// The rig of the plan's poses: as if the part lay where it should.
Rig RigOfPoses(const PlanningSession& session) {
  Rig rig = session.inspection.rig;
  rig.part_placement.reset();
  return rig;
}

v1::ScanQuality::Spread ToProto(const Spread& spread, double factor = 1) {
  v1::ScanQuality::Spread message;
  message.set_low(factor * spread.low);
  message.set_median(factor * spread.median);
  message.set_high(factor * spread.high);
  return message;
}

v1::ScanQuality ToProto(const ScanQuality& quality) {
  v1::ScanQuality message;
  *message.mutable_pixel_footprint_m() = ToProto(quality.pixel_footprint_m);
  *message.mutable_depth_per_pixel_m() = ToProto(quality.depth_per_pixel_m);
  *message.mutable_triangulation_angle_deg() = ToProto(quality.triangulation_angle_rad, kDegPerRad);
  *message.mutable_camera_incidence_deg() = ToProto(quality.camera_incidence_rad, kDegPerRad);
  *message.mutable_laser_incidence_deg() = ToProto(quality.laser_incidence_rad, kDegPerRad);
  return message;
}

std::vector<TargetBits> CoveredBy(const PlanDocument& document) {
  std::vector<TargetBits> covered;
  for (const ChosenScan& scan : document.scans) covered.push_back(scan.exact.covered);
  return covered;
}

}  // namespace

Eigen::Isometry3f ToStage(const PlanningSession& session) {
  return session.measured ? session.measured->registration.pose.Matrix().cast<float>()
                          : Eigen::Isometry3f::Identity();
}

void AddScanQuality(const PlanningSession& session, PlanDocument& document) {
  const Rig rig = RigOfPoses(session);
  const Eigen::Isometry3f to_stage = ToStage(session);
  const std::vector<double> overlaps = Overlaps(CoveredBy(document));
  std::vector<v1::PlannedScan*> scans;
  for (v1::PlannedScan& scan : *document.plan.mutable_scans()) scans.push_back(&scan);
  std::vector<absl::Status> got(document.scans.size());
  const auto add = [&](size_t i) -> absl::Status {
    const ChosenScan& scan = document.scans[i];
    if (scan.exact.feasibility != ScanFeasibility::kFeasible) return absl::OkStatus();
    SIGHTLINE_ASSIGN_OR_RETURN(auto given, session.client->MeasurementPoints(scan.measurement));
    std::vector<MeasuredPoint> points;
    points.reserve(given.size());
    for (const ScanPoint& point : given) {
      points.push_back(
          {to_stage * point.position_m, to_stage.linear() * point.normal, point.frame});
    }
    const std::optional<ScanQuality> quality =
        QualityOfScan(rig, scan.measurement, session.model_centre_m, points);
    if (!quality) return absl::OkStatus();
    v1::ScanQuality message = ToProto(*quality);
    message.set_overlap(overlaps[i]);
    *scans[i]->mutable_quality() = std::move(message);
    return absl::OkStatus();
  };
  absl::Status all = ForEachIndex(document.scans.size(), [&](size_t i) {
    got[i] = add(i);
    return absl::OkStatus();
  });
  if (!all.ok()) document.Miss("quality of scans", all);
  for (size_t i = 0; i < got.size(); ++i) {
    if (!got[i].ok()) document.Miss(absl::StrCat("quality of scan ", i + 1), got[i]);
  }
}

std::vector<float> DepthPerPixel(const PlanningSession& session, const PlanDocument& document,
                                 const TargetSet& targets) {
  std::vector<Measurement> measurements;
  for (const ChosenScan& scan : document.scans) measurements.push_back(scan.measurement);
  return BestDepthPerPixel(RigOfPoses(session), measurements, CoveredBy(document),
                           session.model_centre_m, targets);
}

absl::Status WriteSetUpFiles(const ReportData& data, const std::string& folder) {
  SetUpSheet sheet{.plan = data.plan,
                   .part_name = data.part_name,
                   .mesh = data.mesh,
                   .pictures_png = {},
                   .face_pictures_png = data.face_pictures_png,
                   .one_housing = data.one_housing};
  for (const ReportScan& scan : data.scans) {
    sheet.pictures_png.push_back(scan.near_view_png.empty() ? scan.rendered_view_png
                                                            : scan.near_view_png);
  }
  SIGHTLINE_ASSIGN_OR_RETURN(const auto report, SetUpReport(sheet));
  SIGHTLINE_RETURN_IF_ERROR(WriteReport(report, absl::StrCat(folder, "/", kSetUpSheetFile)));
  SIGHTLINE_ASSIGN_OR_RETURN(const auto exports, ExportPlan(data.plan));
  const std::string export_folder = folder + "/exports";
  SIGHTLINE_RETURN_IF_ERROR(MakeOutputFolder(export_folder));
  for (const ExportFile& file : exports) {
    SIGHTLINE_RETURN_IF_ERROR(
        WriteFileAtomically(absl::StrCat(export_folder, "/", file.name), file.contents));
  }
  return absl::OkStatus();
}

}  // namespace sightline
