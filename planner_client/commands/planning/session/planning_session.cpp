// SPDX-License-Identifier: Apache-2.0
#include "planner_client/commands/planning/session/planning_session.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <numbers>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/inspection/read_with_files.h"
#include "core/json/strict_json.h"
#include "core/random/random.h"
#include "core/rig/sensor_bodies.h"
#include "core/status/status_macros.h"
#include "core/text/number_text.h"
#include "planner_client/command_line/process/interrupt.h"
#include "planner_client/command_line/process/print.h"
#include "planner_client/command_line/process/progress_line.h"
#include "planner_client/commands/planning/session/robot_outputs.h"
#include "planner_client/commands/planning/session/session_light.h"
#include "planner_client/gain_model/coverage_gain_model.h"
#include "planner_client/part_files/part_file.h"
#include "planner_client/tolerance_import/tolerance_import.h"
#include "planning/requirements/joined_scans.h"
#include "planning/requirements/reach.h"

namespace sightline {
namespace {

// Plans are scored on validation targets only exactly. Their direction field only serves to find
// the measurable ones, for which directions between its own are tried anyway.
constexpr int kFreshFieldDirections = 576;

// Fraction of opening a session for the light of the materials, if requested.
constexpr ProgressPhase kLightPhase{kOpenSessionPhase.begin, 0.5 * kOpenSessionPhase.end};

// Seed different from that of the plan's own targets, but derived from it.
int64_t FreshSeed(int64_t seed) {
  return static_cast<int64_t>(DeriveSeed(static_cast<uint64_t>(seed), 41) >> 1);
}

// True if camera and laser overlap at the extreme distances and angles of the domain.
bool NoRoomForBodies(const Inspection& inspection) {
  const auto ends = [](const ParameterDomain& domain) {
    std::vector<double> values = domain.values;
    for (const ParameterDomain::Range& range : domain.ranges) {
      values.push_back(range.min);
      values.push_back(range.max);
    }
    return values;
  };
  Measurement m;
  for (const double distance_m : ends(inspection.domain.parameters[0])) {
    for (const double angle_rad : ends(inspection.domain.parameters[1])) {
      m.camera_distance_m = distance_m;
      m.triangulation_angle_rad = angle_rad;
      if (!SensorBodiesCollide(inspection.rig, MakeScanGeometry(inspection.rig, m))) return false;
    }
  }
  return true;
}

// Faces that the part rests on, and limits that follow from the required resolution.
absl::Status HoldPartOf(PlanningSession& session) {
  DeriveLimits(&session.inspection);
  SIGHTLINE_ASSIGN_OR_RETURN(session.held, HoldPart(*session.part, &session.inspection));
  return absl::OkStatus();
}

void PrintRests(const HeldPart& held) {
  if (held.faces.empty()) return;
  std::string faces;
  for (const RestingFace& face : held.faces) {
    absl::StrAppend(&faces, faces.empty() ? "" : ", ", face.name);
    if (face.stability_rad > 0) {
      absl::StrAppendFormat(&faces, " (topples at %.0f deg)",
                            face.stability_rad * 180 / std::numbers::pi);
    }
  }
  PrintTextTo(stderr, "part: rests on faces %s\n", faces.c_str());
  for (const ExcludedRest& excluded : held.excluded) {
    PrintTextTo(stderr, "part: face %s is not used: %s\n", excluded.face.name.c_str(),
                excluded.because.c_str());
  }
}

std::string LimitsText(const TargetSampling& targets) {
  std::string text;
  const auto add = [&](const char* name, const std::optional<double>& limit, const char* format) {
    if (!limit || *limit == 0) return;
    absl::StrAppend(&text, text.empty() ? "" : ", ", name, " ", NumberText(*limit), format);
  };
  add("max_pixel_footprint_m", targets.max_pixel_footprint_m, " m");
  add("max_depth_per_pixel_m", targets.max_depth_per_pixel_m, " m");
  add("max_circle_of_confusion_px", targets.max_circle_of_confusion_px, " px");
  std::optional<double> incidence_deg;
  if (targets.max_incidence_rad) {
    incidence_deg = std::round(*targets.max_incidence_rad * 180 / std::numbers::pi * 1e6) / 1e6;
  }
  add("max_incidence_deg", incidence_deg, " deg");
  return text.empty() ? "none" : text;
}

// Fraction of the admissible uncertainty that the search may use: shared errors depend on the whole
// plan, which the search does not know.
// from the whole plan and are not known to it.
constexpr float kSharedErrorMargin = 0.9F;

absl::Status MakeGainModel(PlanningSession& session) {
  if (!session.ForUncertainty()) {
    session.gain_model =
        std::make_unique<CoverageGainModel>(*session.client, session.validation_client.get());
    return absl::OkStatus();
  }
  const Requirements& requirements = *session.requirements;
  const UncertaintyModel& model = *session.inspection.uncertainty;
  const bool shared = HasSharedErrors(session.inspection);
  const auto judge = [&](CoverageClient* client) -> UncertaintyGainModel::Sampling {
    if (client == nullptr) return {nullptr, {}};
    std::vector<float> admissible_m = requirements.AdmissibleUncertainties(client->targets());
    const float margin = shared ? kSharedErrorMargin : 1;
    for (float& u_m : admissible_m) u_m *= margin;
    return {client,
            FindTolerancedTargets(*client, model, session.inspection.targets,
                                  std::move(admissible_m), requirements.relaxed_uncertainty_m)};
  };
  auto gain_model = std::make_unique<UncertaintyGainModel>(
      judge(session.client.get()), judge(session.validation_client.get()), model,
      session.inspection.goal.gain, requirements.relaxed_uncertainty_m);
  PrintTextTo(stderr, "tolerances: they bind %lld of the measurable targets\n",
              static_cast<long long>(gain_model->measurable().Count()));
  session.gain_model = std::move(gain_model);
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<std::optional<Requirements>> ReadRequirements(const Inspection& inspection,
                                                             const TriangleMesh& part) {
  if (!inspection.tolerances || !inspection.uncertainty) return std::nullopt;
  std::optional<ToleranceReport> report;
  std::vector<FaceTriangles> faces;
  if (const std::string& file = inspection.tolerances->file; !file.empty()) {
    ToleranceImportOptions options;
    options.length_unit = inspection.tolerances->file_unit;
    SIGHTLINE_ASSIGN_OR_RETURN(auto read, ImportTolerances(file, options));
    SIGHTLINE_ASSIGN_OR_RETURN(faces, FacesOf(read, part));
    report = std::move(read.report);
  }
  SIGHTLINE_ASSIGN_OR_RETURN(auto requirements, MakeRequirements(inspection, part, report, faces));
  for (const UnreadTolerance& tolerance : requirements.left_out) {
    PrintTextTo(stderr, "tolerance left out: %s: %s\n", tolerance.name.c_str(),
                tolerance.reason.c_str());
  }
  return std::optional<Requirements>(std::move(requirements));
}

absl::StatusOr<PlanningSession> OpenSession(const SessionOptions& options) {
  const auto start = std::chrono::steady_clock::now();
  PlanningSession session;
  SIGHTLINE_ASSIGN_OR_RETURN(session.inspection, ReadInspectionWithFiles(options.inspection_file));
  if (options.line_detection && session.inspection.uncertainty) {
    session.inspection.uncertainty->detection = *options.line_detection;
  }

  PartFileOptions part_options;
  part_options.construction_geometry = session.inspection.part_construction_geometry;
  SIGHTLINE_ASSIGN_OR_RETURN(auto part, LoadPartFile(session.inspection.part_file,
                                                     session.inspection.part_unit, part_options));
  session.health = CheckPartHealth(part);
  session.part = std::make_shared<const TriangleMesh>(std::move(part));
  session.part_digest = PartDigestOf(*session.part);
  SIGHTLINE_ASSIGN_OR_RETURN(
      session.plan_remarks,
      options.plans.CheckBelongTo(session.part_digest, session.inspection.part_file));
  for (const std::string& remark : session.plan_remarks) {
    PrintTextTo(stderr, "warning: %s\n", remark.c_str());
  }
  session.model_centre_m = session.part->BoundingBox().center();
  const Eigen::Vector3d size_mm = 1e3 * session.health.bounding_box_m.sizes();
  PrintTextTo(stderr, "part: %s, %.1f x %.1f x %.1f mm, %lld triangles, %.1f cm2\n",
              std::filesystem::path(session.inspection.part_file).filename().c_str(), size_mm.x(),
              size_mm.y(), size_mm.z(), static_cast<long long>(session.health.triangle_count),
              1e4 * session.health.area_m2);
  for (const std::string& finding : session.health.findings) {
    PrintTextTo(stderr, "part: %s\n", finding.c_str());
  }

  SIGHTLINE_RETURN_IF_ERROR(HoldPartOf(session));
  SIGHTLINE_ASSIGN_OR_RETURN(session.requirements,
                             ReadRequirements(session.inspection, *session.part));
  if (session.requirements && session.ForUncertainty()) {
    SIGHTLINE_RETURN_IF_ERROR(CheckReach(session.inspection, *session.requirements));
  }

  CoverageTask task;
  SIGHTLINE_ASSIGN_OR_RETURN(
      auto light, LightOfSession(options.inspection_file, session.inspection, *session.part,
                                 options.worker, kLightPhase));
  if (light) {
    task.detectability = std::move(light->detectability);
    for (std::string& remark : light->remarks) session.plan_remarks.push_back(std::move(remark));
  }
  task.part = session.part;
  task.part_name = session.inspection.part_file;
  task.rig = session.inspection.rig;
  task.sampling = session.inspection.targets;
  task.field_directions = options.field_directions;
  task.uncertainty = session.inspection.uncertainty;
  std::vector<PlacedObstacle> placed;
  for (const ObstacleSource& source : session.inspection.obstacles) {
    SIGHTLINE_ASSIGN_OR_RETURN(auto mesh, LoadPartFile(source.file, source.unit));
    std::string name = source.name;
    if (name.empty()) name = std::filesystem::path(source.file).filename().string();
    task.obstacles.push_back(
        {std::make_shared<const TriangleMesh>(std::move(mesh)), source.frame, name});
    placed.push_back({task.obstacles.back().mesh.get(), source.frame, name});
  }
  if (absl::Status left =
          ExcludeBlockedRests(*session.part, placed, &session.inspection, &session.held);
      !left.ok()) {
    return absl::Status(left.code(), absl::StrCat(options.inspection_file, ": ", left.message()));
  }
  PrintRests(session.held);
  task.domain = session.inspection.domain;
  if (absl::Status clear =
          CheckObstaclesClear(*session.part, session.inspection, session.held, placed);
      !clear.ok()) {
    return absl::Status(clear.code(), absl::StrCat(options.inspection_file, ": ", clear.message()));
  }
  if (session.held.table) {
    task.obstacles.push_back({std::make_shared<const TriangleMesh>(*session.held.table),
                              ObstacleFrame::kTable, "table"});
  }
  if (options.before_upload) {
    SIGHTLINE_RETURN_IF_ERROR(options.before_upload(session, task));
  }
  session.obstacles = task.obstacles;

  if (absl::Status status = OpenRobotCell(task, &session); !status.ok()) {
    return absl::Status(status.code(),
                        absl::StrCat(options.inspection_file, ": ", status.message()));
  }

  CoverageClientOptions client;
  client.address = options.coverage_server;
  client.interrupted = &InterruptFlag();
  SIGHTLINE_RETURN_IF_ERROR(UseServerTls(options.tls, !options.coverage_server.empty(), &client));
  if (options.coverage_server.empty()) {
    EmbeddedServerOptions embedded;
    embedded.interrupted = &InterruptFlag();
    SIGHTLINE_ASSIGN_OR_RETURN(session.server, EmbeddedServer::Start(std::move(embedded)));
    client.embedded = session.server.get();
  }
  ProgressPhase phase = kOpenSessionPhase;
  if (task.detectability) phase.begin = kLightPhase.end;
  const double middle = (phase.begin + phase.end) / 2;
  if (options.fresh_targets) phase.end = middle;
  ProgressLine progress(phase);
  // Called by Open only: the clients outlive this function.
  client.on_progress = [&progress](double fraction, const std::string& message) {
    progress.Show(fraction, message);
  };
  CoverageTask validation_task = task;
  const bool light_limits = task.detectability.has_value();
  SIGHTLINE_ASSIGN_OR_RETURN(session.client, CoverageClient::Open(client, std::move(task)));
  if (options.fresh_targets) {
    progress.Enter({middle, kOpenSessionPhase.end});
    validation_task.sampling.seed = FreshSeed(validation_task.sampling.seed);
    validation_task.field_directions =
        std::min(validation_task.field_directions, kFreshFieldDirections);
    SIGHTLINE_ASSIGN_OR_RETURN(session.validation_client,
                               CoverageClient::Open(std::move(client), std::move(validation_task)));
  }
  progress.Finish();
  const SceneInfo& scene = session.client->scene();
  session.open_time_s =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  const auto percent = [&](int64_t count) {
    return 100.0 * static_cast<double>(count) / static_cast<double>(scene.target_count);
  };
  PrintTextTo(stderr,
              "targets: %lld, of which %lld (%.1f %%) can be measured with this rig (%.1f %% by "
              "sensors anywhere); ready after %.1f s\n",
              static_cast<long long>(scene.target_count),
              static_cast<long long>(scene.measurable_count), percent(scene.measurable_count),
              percent(scene.measurable_in_free_space_count), session.open_time_s);
  if (scene.measurable_count == 0) {
    return absl::InvalidArgumentError(
        scene.measurable_in_free_space_count == 0
            ? absl::StrCat(session.inspection.part_file,
                           ": no target on this part can be measured: none is visible from "
                           "two directions 10 to 80 degrees apart")
        : NoRoomForBodies(session.inspection)
            ? absl::StrCat(options.inspection_file,
                           ": the bodies of camera and laser (rig.camera_bodies, "
                           "rig.laser_bodies) overlap at the shortest and longest "
                           "measurement.camera_distance_m and triangulation_angle_deg")
            : absl::StrCat(options.inspection_file,
                           ": no target on this part can be measured by the scans that rig, "
                           "`measurement` and the limits of `targets` allow; the limits in force: ",
                           LimitsText(session.inspection.targets),
                           session.inspection.rig.clearance_m > 0
                               ? absl::StrCat(", rig.clearance_m ",
                                              NumberText(session.inspection.rig.clearance_m), " m")
                               : "",
                           light_limits ? ", and the light of the materials (detectability)" : ""));
  }
  SIGHTLINE_RETURN_IF_ERROR(MakeGainModel(session));
  AskRobotFirst(options.kept_scans, &session);
  return session;
}

}  // namespace sightline
