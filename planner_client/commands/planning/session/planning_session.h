// SPDX-License-Identifier: Apache-2.0
// The common start of every planning command: the inspection, its part, and a coverage server that
// knows them.
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
  // Empty: an embedded server is started.
  std::string coverage_server;
  ServerTlsOptions tls;  // of that server
  // Computes the light of the part's materials, where the inspection limits targets by it.
  WorkerSessionOptions worker;
  int field_directions = kDefaultFieldDirections;
  // Also sample validation targets, which the search does not see, to score plans on.
  bool fresh_targets = true;
  // Instead of the inspection's, which must have an uncertainty.
  std::optional<LineDetectionNoise> line_detection;
  // Scans that are in the plan whether or not the inspection's robot reaches them.
  std::vector<Measurement> kept_scans;
  // Plans that scans were taken from; those of another part are refused.
  GivenPlans plans;
  // Called with the inspection, its part and its obstacles as they were read, before anything is
  // uploaded; planning uses its changes. May be null.
  std::function<absl::Status(PlanningSession&, CoverageTask&)> before_upload;
};

struct PlanningSession {
  Inspection inspection;
  std::shared_ptr<const TriangleMesh> part;
  // Digest of the CAD file's part, even if `part` is the part as measured.
  PartDigest part_digest;
  // Remarks on the plans that scans were taken from, for the first lines of reports.
  std::vector<std::string> plan_remarks;
  // The support of the part; the domain of `inspection` has its orientations.
  HeldPart held;
  PartHealth health;
  // Centre of the CAD model's bounding box, which the rig's offsets refer to.
  Eigen::Vector3d model_centre_m = Eigen::Vector3d::Zero();
  // For plans that go on from measured scans: the part as these found it (`part` is its mesh, and
  // the rig of `inspection` has its placement), and the gain model of their points, which
  // `gain_model` owns. Null of other plans.
  std::shared_ptr<const MeasuredPart> measured;
  MeasuredGainModel* measured_gain_model = nullptr;
  // As the coverage server knows them.
  std::vector<CoverageTask::Obstacle> obstacles;
  std::shared_ptr<const RobotCell> robot;  // null without rig.robot
  std::unique_ptr<EmbeddedServer> server;  // null with --coverage-server
  std::unique_ptr<CoverageClient> client;
  std::unique_ptr<CoverageClient> validation_client;  // null without validation targets
  std::optional<Requirements> requirements;           // of inspections with tolerances
  // For coverage, or for uncertainty where the goal asks for it.
  std::unique_ptr<GainModel> gain_model;
  double open_time_s = 0;  // from start to the first possible query

  bool ForUncertainty() const { return inspection.goal.admissible.has_value(); }
};

// The requirements of an inspection with tolerances and uncertainty, the file of tolerances read
// and the tolerances that are left out printed; unset for others.
absl::StatusOr<std::optional<Requirements>> ReadRequirements(const Inspection& inspection,
                                                             const TriangleMesh& part);

// The part of a planning command that opening a session is.
inline constexpr ProgressPhase kOpenSessionPhase{0, 0.2};

// Prints the part's health findings and shows progress on stderr.
absl::StatusOr<PlanningSession> OpenSession(const SessionOptions& options);

}  // namespace sightline
