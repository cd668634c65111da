// SPDX-License-Identifier: Apache-2.0
#include "planner_client/commands/planning/plan_outputs.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <set>
#include <system_error>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/string_view.h"
#include "absl/strings/strip.h"
#include "core/file/atomic_write.h"
#include "core/json/strict_json.h"
#include "core/parallel/for_each_index.h"
#include "core/part/load_part.h"
#include "core/part/part_health_proto.h"
#include "core/physics/angle.h"
#include "core/status/status_macros.h"
#include "planner_client/command_line/process/output_folder.h"
#include "planner_client/command_line/process/print.h"
#include "planner_client/commands/planning/document/placement_outputs.h"
#include "planner_client/commands/planning/document/set_up_outputs.h"
#include "planner_client/commands/planning/document/uncertainty_outputs.h"
#include "planner_client/commands/planning/document/uncovered_outputs.h"
#include "planner_client/commands/planning/session/robot_outputs.h"
#include "report/document/report_page.h"
#include "report/plan/plan_csv.h"

namespace sightline {
namespace {

// scan_NN.ply or scan_NN_ellipsoids.ply
bool IsPointCloud(absl::string_view name) {
  if (!absl::ConsumePrefix(&name, "scan_") || !absl::ConsumeSuffix(&name, ".ply")) return false;
  absl::ConsumeSuffix(&name, "_ellipsoids");
  return name.size() >= 2 && std::all_of(name.begin(), name.end(), [](char c) {
           return absl::ascii_isdigit(static_cast<unsigned char>(c));
         });
}

// Files about the scans of the plan that was in the folder before.
absl::Status RemoveEarlierPlan(const std::string& folder) {
  namespace fs = std::filesystem;
  SIGHTLINE_RETURN_IF_ERROR(
      RemoveFiles(folder, {"report.html", "report.json", "uncertainty.ply", "plan.qif"}));
  const fs::path points = fs::path(folder) / "points";
  std::vector<std::string> clouds;
  std::error_code error;
  for (fs::directory_iterator entry(points, error), end; !error && entry != end;
       entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    if (IsPointCloud(name)) clouds.push_back(name);
  }
  for (const std::string& cloud : clouds) {
    SIGHTLINE_RETURN_IF_ERROR(RemoveFiles(points.string(), {cloud}));
  }
  fs::remove(points, error);  // if nothing else is in it
  return absl::OkStatus();
}

// Moves part and targets of a report to the registered pose of the part, among the plan's poses.
void ShowWhereItLies(const PlanningSession& session, ReportData* data) {
  if (!session.measured) return;
  const Eigen::Isometry3f to_stage = ToStage(session);
  for (Eigen::Vector3f& place : data->mesh.positions_m) place = to_stage * place;
  for (Eigen::Vector3f& place : data->targets.positions_m) place = to_stage * place;
  for (Eigen::Vector3f& normal : data->targets.normals) normal = to_stage.linear() * normal;
  for (const MeasuredPart::TargetDeviation& target : session.measured->deviations) {
    data->deviations.push_back(
        {target.position_m, target.normal, target.mean_m, target.significant});
  }
}

// The server has meshes that move with the part in coordinates of the measured part.
std::shared_ptr<const TriangleMesh> MeshWhereItLies(const PlanningSession& session,
                                                    const CoverageTask::Obstacle& obstacle) {
  if (!session.measured || obstacle.frame != ObstacleFrame::kPart) return obstacle.mesh;
  TriangleMesh moved = *obstacle.mesh;
  const Eigen::Isometry3f to_stage = ToStage(session);
  for (Eigen::Vector3f& place : moved.positions_m) place = to_stage * place;
  return std::make_shared<const TriangleMesh>(std::move(moved));
}

// All that a report says, apart from pictures and points.
absl::StatusOr<ReportData> DescribeForReport(const PlanningSession& session,
                                             const PlanDocument& document,
                                             const OutputOptions& options) {
  const CoverageClient& client = *session.client;
  ReportData data;
  data.plan = document.plan;
  data.health = PartHealthToProto(session.health);
  data.part_name = std::filesystem::path(session.inspection.part_file).filename().string();
  data.mesh = *session.part;
  data.rig = session.inspection.rig;
  data.targets = client.targets();
  data.one_housing = session.inspection.sensor_mount == SensorMount::kRigid || session.robot;
  ShowWhereItLies(session, &data);
  data.sampling = session.inspection.targets;
  data.measurable = session.client->measurable();
  data.reasons = document.reasons;
  if (const v1::SceneSpec& spec = client.scene().spec; spec.has_detectability()) {
    data.permitted_exposures = {spec.detectability().min_exposure_time_s(),
                                spec.detectability().max_exposure_time_s()};
  }
  for (size_t i = 0; i < session.obstacles.size(); ++i) {
    data.obstacles.push_back({session.obstacles[i].name,
                              client.scene().spec.obstacles(static_cast<int>(i)).frame(),
                              MeshWhereItLies(session, session.obstacles[i])});
  }
  if (session.robot) data.robot = RobotForReport(session, document.plan);
  data.comparison = options.comparison;
  data.pareto = options.pareto;
  if (session.ForUncertainty()) {
    data.uncertainty = TargetUncertaintiesOf(session, document);
    SIGHTLINE_RETURN_IF_ERROR(
        WriteUncertaintyFiles(session, document, *data.uncertainty, options.folder));
    if (options.point_clouds) data.uncertainty->scan_sensitivities.resize(document.scans.size());
  } else if (options.ellipsoids) {
    PrintTextTo(stderr,
                "warning: --ellipsoids has no effect: the inspection's goal is coverage, not "
                "uncertainty\n");
  }
  return data;
}

// Viewing distance for a part of unit size if the sensors need not be visible.
constexpr double kNearView = 2.2;

// View of the part and the scan's rig in the middle of its travel, from `distance_m`; at 0, from a
// distance that shows everything. `covered`: until then.
absl::StatusOr<std::string> PictureOfScan(const PlanningSession& session, const ChosenScan& scan,
                                          const TargetBits& covered, double distance_m) {
  v1::RenderViewRequest request;
  request.set_view(v1::RenderViewRequest::VIEW_FREE);
  *request.mutable_measurement() = MeasurementToProto(scan.measurement);
  const double middle = 0.5 * (scan.exact.first_frame + scan.exact.last_frame);
  request.set_stage_position_m(std::round(middle) * session.inspection.rig.scan_step_m);
  request.set_azimuth_deg(40);
  request.set_elevation_deg(25);
  request.set_distance_m(distance_m);
  request.set_columns_px(720);
  request.set_rows_px(540);
  request.set_covered_targets(covered.ToBytes());
  return session.client->RenderView(std::move(request));
}

// The face that lies on the table, seen square-on from outside the part.
absl::StatusOr<std::string> PictureOfFace(const PlanningSession& session,
                                          const v1::RestingFace& face) {
  const Eigen::Vector3d normal(face.normal().x(), face.normal().y(), face.normal().z());
  v1::RenderViewRequest request;
  request.set_view(v1::RenderViewRequest::VIEW_FREE);
  request.set_azimuth_deg(std::atan2(normal.y(), normal.x()) * kDegPerRad);
  request.set_elevation_deg(std::atan2(normal.z(), std::hypot(normal.x(), normal.y())) *
                            kDegPerRad);
  request.set_columns_px(720);
  request.set_rows_px(540);
  return session.client->RenderView(std::move(request));
}

absl::StatusOr<std::string> PictureOfTargets(const PlanningSession& session,
                                             v1::RenderViewRequest::View view,
                                             const TargetBits& covered) {
  v1::RenderViewRequest request;
  request.set_view(view);
  request.set_azimuth_deg(-60);
  request.set_elevation_deg(35);
  request.set_columns_px(960);
  request.set_rows_px(640);
  if (view == v1::RenderViewRequest::VIEW_COVERAGE) {
    request.set_covered_targets(covered.ToBytes());
  }
  return session.client->RenderView(std::move(request));
}

// For plans with uncertainty, writes the sensitivity of the scan's points to `sensitivity`.
absl::Status WritePointsOfScan(const PlanningSession& session, const ChosenScan& scan, size_t index,
                               const std::vector<ScanPoint>& points, const OutputOptions& options,
                               ScanSensitivityMap* sensitivity) {
  const auto path = [&](const char* kind) {
    return absl::StrFormat("%s/points/scan_%02d%s.ply", options.folder, index + 1, kind);
  };
  std::vector<Eigen::Vector3f> positions, normals;
  const Eigen::Isometry3f to_stage = ToStage(session);
  for (const ScanPoint& p : points) {
    positions.push_back(to_stage * p.position_m);
    normals.push_back(to_stage.linear() * p.normal);
  }
  absl::Status status = WritePlyPoints(path(""), positions, normals);
  if (!status.ok() || sensitivity == nullptr) return status;
  *sensitivity = SensitivityOf(session, scan.measurement, points);
  for (Eigen::Vector3f& place : sensitivity->positions_m) place = to_stage * place;
  if (!options.ellipsoids) return absl::OkStatus();
  return WriteEllipsoids(session, scan.measurement, points, path("_ellipsoids"));
}

// Answers of the server for the outputs of a scan.
struct ScanAnswers {
  absl::Status picture, points;
};

// Writes pictures and point clouds for several scans at a time. Data that the server does not give
// are listed as missing.
absl::Status ShowScans(const PlanningSession& session, PlanDocument& document,
                       const OutputOptions& options, ReportData* data) {
  std::vector<TargetBits> covered_until;
  TargetBits covered(data->targets.size());
  for (const ChosenScan& scan : document.scans) {
    covered |= scan.exact.covered;
    covered_until.push_back(covered);
    data->scans.emplace_back().covered = scan.exact.covered;
  }
  if (options.point_clouds && !document.scans.empty()) {
    SIGHTLINE_RETURN_IF_ERROR(MakeOutputFolder(options.folder + "/points"));
  }
  const auto picture = [](absl::StatusOr<std::string> png, std::string* place) {
    if (!png.ok()) return png.status();
    *place = *std::move(png);
    return absl::OkStatus();
  };
  std::set<int> begins_setup;
  for (const v1::Setup& setup : document.plan.setups()) begins_setup.insert(setup.scans(0));
  const double part_size_m = data->mesh.BoundingBox().sizes().norm();
  std::vector<ScanAnswers> answers(document.scans.size());
  absl::Status status = ForEachIndex(document.scans.size(), [&](size_t i) -> absl::Status {
    const ChosenScan& scan = document.scans[i];
    if (options.pictures) {
      ReportScan& shown = data->scans[i];
      answers[i].picture =
          picture(PictureOfScan(session, scan, covered_until[i], 0), &shown.rendered_view_png);
      if (answers[i].picture.ok() && begins_setup.contains(static_cast<int>(i) + 1)) {
        answers[i].picture =
            picture(PictureOfScan(session, scan, covered_until[i], kNearView * part_size_m),
                    &shown.near_view_png);
      }
    }
    if (!options.point_clouds) return absl::OkStatus();
    const auto points = session.client->MeasurementPoints(scan.measurement);
    // A scan given by hand that collides has none.
    if (absl::IsFailedPrecondition(points.status())) return absl::OkStatus();
    answers[i].points = points.status();
    if (!points.ok()) return absl::OkStatus();
    return WritePointsOfScan(
        session, scan, i, *points, options,
        data->uncertainty ? &data->uncertainty->scan_sensitivities[i] : nullptr);
  });
  for (size_t i = 0; i < answers.size(); ++i) {
    const auto& [shown, measured] = answers[i];
    if (!shown.ok()) document.Miss(absl::StrCat("picture of scan ", i + 1), shown);
    if (!measured.ok()) document.Miss(absl::StrCat("points of scan ", i + 1), measured);
  }
  if (!status.ok() || !options.pictures) return status;
  for (const v1::RestingFace& face : document.plan.resting_faces()) {
    const absl::Status shown =
        picture(PictureOfFace(session, face), &data->face_pictures_png.emplace_back());
    if (!shown.ok()) document.Miss(absl::StrCat("picture of face ", face.name()), shown);
  }
  using View = v1::RenderViewRequest;
  const absl::Status measurability = picture(
      PictureOfTargets(session, View::VIEW_MEASURABILITY, covered), &data->measurability_png);
  if (!measurability.ok()) document.Miss("picture of what is measurable", measurability);
  const absl::Status coverage =
      picture(PictureOfTargets(session, View::VIEW_COVERAGE, covered), &data->coverage_png);
  if (!coverage.ok()) document.Miss("picture of what is measured", coverage);
  return absl::OkStatus();
}

}  // namespace

absl::Status WritePlanJson(const PlanDocument& document, const std::string& folder) {
  SIGHTLINE_RETURN_IF_ERROR(MakeOutputFolder(folder));
  SIGHTLINE_RETURN_IF_ERROR(RemoveEarlierPlan(folder));
  SIGHTLINE_RETURN_IF_ERROR(WriteFileAtomically(folder + "/plan.json", ToJson(document.plan)));
  return WriteFileAtomically(folder + "/plan.csv", PlanCsv(document.plan));
}

absl::Status WritePlanOutputs(PlanningSession& session, PlanDocument& document,
                              const OutputOptions& options) {
  SIGHTLINE_RETURN_IF_ERROR(WritePlanJson(document, options.folder));
  const auto explaining = std::chrono::steady_clock::now();
  if (absl::Status status = ExplainUncovered(session, &document); !status.ok()) {
    document.Miss("reasons why targets are not covered", status);
  }
  const auto placing = std::chrono::steady_clock::now();
  if (absl::Status status = AddPlacementCoverage(session, &document); !status.ok()) {
    document.Miss("coverage under errors of placement", status);
  }
  const auto start = std::chrono::steady_clock::now();
  SIGHTLINE_RETURN_IF_ERROR(WritePlanJson(document, options.folder));
  SIGHTLINE_ASSIGN_OR_RETURN(auto data, DescribeForReport(session, document, options));
  SIGHTLINE_RETURN_IF_ERROR(ShowScans(session, document, options, &data));
  SIGHTLINE_RETURN_IF_ERROR(WriteSetUpFiles(data, options.folder));
  data.set_up_sheet = kSetUpSheetFile;
  data.depth_per_pixel_m = DepthPerPixel(session, document, data.targets);
  data.timings = options.timings;
  const auto seconds = [](auto from, auto to) {
    return std::chrono::duration<double>(to - from).count();
  };
  data.timings.push_back({"reasons of uncovered targets", seconds(explaining, placing)});
  data.timings.push_back({"coverage under errors of placement", seconds(placing, start)});
  data.timings.push_back(
      {"pictures and point clouds", seconds(start, std::chrono::steady_clock::now())});
  for (const std::string& missing : document.missing) {
    data.notes.push_back(missing);
    PrintTextTo(stderr, "warning: %s\n", missing.c_str());
  }
  SIGHTLINE_ASSIGN_OR_RETURN(auto report, PlanReport(data));
  return WriteReport(report, options.folder + "/report.html");
}

}  // namespace sightline
