// SPDX-License-Identifier: Apache-2.0
// `sightline plan ... --measured FILE`: continues planning after some scans have been measured.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "planner_client/commands/planning/document/plan_document.h"
#include "planner_client/commands/planning/session/planning_session.h"
#include "planner_client/replanning/measured_part.h"
#include "planning/strategy/planner.h"
#include "sightline/v1/plan.pb.h"

namespace sightline {

struct AsMeasuredOptions {
  std::vector<std::string> files;  // empty: nothing was measured
  // Prior standard deviations of the pose, for each axis.
  double pose_prior_mm = 5;
  double pose_prior_deg = 3;
  double tolerated_distance_mm = 2;
  std::string unit = "m";  // of files of points that state none
  std::string pose_file;   // CAD coordinates from those of the points; empty: none
};

void AddAsMeasuredOptions(CLI::App& app, AsMeasuredOptions* options);
// Adds only the options about reading and registering points.
void AddRegistrationOptions(CLI::App& app, AsMeasuredOptions* options);
// INVALID_ARGUMENT names the file of the pose and its error.
absl::StatusOr<MeasuredPartOptions> PartOptionsOf(const AsMeasuredOptions& options);

// A line on stderr for each scan that has outliers or points without a value.
void PrintPointCounts(const MeasuredPart& part);

// An earlier plan and which of its scans were measured.
struct EarlierPlan {
  std::vector<Measurement> scans;
  std::vector<MeasuredFile> files;  // one per measured scan, in the order of the scans
  std::vector<Measurement> Measured() const;
};

// Reads the plan.json in `folder`, whose scans `request` already has, and makes the measured ones
// its first locked scans. INVALID_ARGUMENT for files that fit no scan, or that are where this
// plan's own points will be written.
absl::StatusOr<EarlierPlan> LockMeasuredScans(const AsMeasuredOptions& options,
                                              const std::string& folder, PlannerRequest* request);

// Replaces the CAD model by the measured part.
absl::Status PutFoundPart(std::shared_ptr<const MeasuredPart> measured, PlanningSession& session,
                          CoverageTask& task);

// Information of the points about the targets of a client's scene; `toleranced` is only used for
// uncertainty.
MeasuredTargets MeasuredTargetsOf(const PlanningSession& session, CoverageClient& client,
                                  std::optional<TolerancedTargets> toleranced);

// Returns SessionOptions::before_upload for such a plan: it registers the part from the points and
// replaces the CAD model by it. `earlier` must outlive the returned function's call.
std::function<absl::Status(PlanningSession&, CoverageTask&)> PutMeasuredPart(
    const AsMeasuredOptions& options, const EarlierPlan& earlier);

// Makes the session's gain model use the points of measured scans.
absl::Status AskMeasuredPoints(const EarlierPlan& earlier, PlanningSession* session);

// Fills in Plan::as_measured: the part as measured, and the changes due to replanning.
absl::Status DescribeAsMeasured(const EarlierPlan& earlier, const PlanningSession& session,
                                PlanDocument* document);

// A few lines for the terminal; empty for plans without measured scans.
std::string SummariseAsMeasured(const v1::Plan& plan);

}  // namespace sightline
