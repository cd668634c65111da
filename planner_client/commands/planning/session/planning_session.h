// SPDX-License-Identifier: Apache-2.0
// Common start of every planning command: loads the inspection and its part, and connects to a
// coverage server that has both.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/inspection/inspection.h"
#include "core/inspection/part_holding.h"
#include "core/part/mesh.h"
#include "core/part/part_digest.h"
#include "core/part/part_health.h"
#include "planner_client/command_line/process/progress_line.h"
#include "planner_client/commands/server_tls.h"
#include "planner_client/commands/worker_session.h"
#include "planner_client/coverage_client/coverage_client.h"
#include "planner_client/gain_model/uncertainty_gain_model.h"
#include "planner_client/replanning/measured_gain_model.h"
#include "planner_client/replanning/measured_part.h"
#include "planning/plan_file/part_of_plan.h"
#include "planning/requirements/requirements.h"
#include "planning/robot/robot_cell.h"

namespace sightline {

struct PlanningSession;

struct SessionOptions {
  std::string inspection_file;
  // Address; if empty, an embedded server is started.
  std::string coverage_server;
  ServerTlsOptions tls;  // of that server
  // For the render worker that computes the materials' light, if light limits targets.
  WorkerSessionOptions worker;
  int field_directions = kDefaultFieldDirections;
  // Also sample validation targets, which are hidden from the search, to score plans on.
  bool fresh_targets = true;
  // Replaces the line detection of the inspection, which must have an uncertainty.
  std::optional<LineDetectionNoise> line_detection;
  // Scans that stay in the plan even if the inspection's robot does not reach them.
  std::vector<Measurement> kept_scans;
  // Plans that scans come from; plans of another part are rejected.
  GivenPlans plans;
  // Called with the inspection, its part and obstacles as read, before the upload; its changes are
  // used for planning. May be null.
  std::function<absl::Status(PlanningSession&, CoverageTask&)> before_upload;
};

struct PlanningSession {
  Inspection inspection;
  std::shared_ptr<const TriangleMesh> part;
  // Digest of the part in the CAD file, even if `part` is the part as measured.
  PartDigest part_digest;
  // Remarks on the plans that scans come from, for the first lines of reports.
  std::vector<std::string> plan_remarks;
  // Support of the part; the domain of `inspection` contains its resting orientations.
  HeldPart held;
  PartHealth health;
  // Centre of the CAD model's bounding box, origin of the rig's offsets.
  Eigen::Vector3d model_centre_m = Eigen::Vector3d::Zero();
  // Only for plans with measured scans: the part as measured (`part` is its mesh, and the rig of
  // `inspection` has its placement), and the gain model of its points, owned by `gain_model`. Null
  // otherwise.
  std::shared_ptr<const MeasuredPart> measured;
  MeasuredGainModel* measured_gain_model = nullptr;
  // Obstacles as sent to the coverage server.
  std::vector<CoverageTask::Obstacle> obstacles;
  std::shared_ptr<const RobotCell> robot;  // null without rig.robot
  std::unique_ptr<EmbeddedServer> server;  // null with --coverage-server
  std::unique_ptr<CoverageClient> client;
  std::unique_ptr<CoverageClient> validation_client;  // null without validation targets
  std::optional<Requirements> requirements;           // of inspections with tolerances
  // For uncertainty if the goal asks for it, else for coverage.
  std::unique_ptr<GainModel> gain_model;
  double open_time_s = 0;  // from start to the first possible query

  bool ForUncertainty() const { return inspection.goal.admissible.has_value(); }
};

// Reads the requirements of an inspection with tolerances and uncertainty, including the file of
// tolerances, and prints tolerances that are left out. Nothing for other inspections.
absl::StatusOr<std::optional<Requirements>> ReadRequirements(const Inspection& inspection,
                                                             const TriangleMesh& part);

// Progress interval of a planning command for opening the session.
inline constexpr ProgressPhase kOpenSessionPhase{0, 0.2};

// Prints the part's health findings and shows progress on stderr.
absl::StatusOr<PlanningSession> OpenSession(const SessionOptions& options);

}  // namespace sightline
