// SPDX-License-Identifier: Apache-2.0
// The files of a plan: plan.json and the others in its folder.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "planner_client/commands/planning/document/plan_document.h"
#include "planner_client/commands/planning/session/planning_session.h"
#include "report/plan/report.h"
#include "sightline/v1/pareto.pb.h"

namespace sightline {

struct OutputOptions {
  std::string folder;
  bool pictures = true;
  bool point_clouds = true;
  bool ellipsoids = false;  // of plans for uncertainty: points/scan_NN_ellipsoids.ply
  std::vector<NamedTiming> timings;
  std::optional<ComparisonTable> comparison;
  std::optional<v1::ParetoFront> pareto;  // of which the plan is a point
};

// Writes plan.json and plan.csv; then, with the reasons why targets stay uncovered, plan.json
// again, pictures, report.html and points/scan_NN.ply. plan.json comes first, so that an
// interruption keeps it; before that, files of an earlier plan about its scans are removed (report,
// point clouds, uncertainty). Data that the server does not give are left out of the files and
// named in the notes of the report and by a warning on stderr: no plan is lost for a picture. The
// errors are those of writing.
absl::Status WritePlanJson(const PlanDocument& document, const std::string& folder);
absl::Status WritePlanOutputs(PlanningSession& session, PlanDocument& document,
                              const OutputOptions& options);

}  // namespace sightline
