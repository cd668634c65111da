// SPDX-License-Identifier: Apache-2.0
// Files of a plan for uncertainty, besides plan.json: maps on the part, files for other programs.
#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "planner_client/commands/planning/document/plan_document.h"
#include "planner_client/commands/planning/session/planning_session.h"
#include "report/plan/report.h"
#include "report/uncertainty/target_uncertainty.h"

namespace sightline {

// The values of every target that the report shows. `document` is that of a plan for uncertainty.
TargetUncertainties TargetUncertaintiesOf(const PlanningSession& session,
                                          const PlanDocument& document);

// Standard uncertainty of a scan's single points along the surface's normal (thesis Fig. 3.5).
ScanSensitivityMap SensitivityOf(const PlanningSession& session, const Measurement& scan,
                                 const std::vector<ScanPoint>& points);

// Writes FOLDER/uncertainty.ply (targets with u and its components) and, with toleranced features,
// FOLDER/plan.qif.
absl::Status WriteUncertaintyFiles(const PlanningSession& session, const PlanDocument& document,
                                   const TargetUncertainties& uncertainties,
                                   const std::string& folder);

// Writes covariance ellipsoids of a scan's points, magnified to a largest axis of 1 mm.
absl::Status WriteEllipsoids(const PlanningSession& session, const Measurement& scan,
                             const std::vector<ScanPoint>& points, const std::string& path);

}  // namespace sightline
