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

// Writes plan.json and plan.csv first, so that an interruption keeps them; files of an earlier
// plan about its scans (report, point clouds, uncertainty) are removed before. Then plan.json is
// written again with the reasons for uncovered targets, with pictures, report.html and
// points/scan_NN.ply. Data that the server does not give are left out, listed in the notes of the
// report and in a warning on stderr: a missing picture does not lose the plan. Errors are those of
// writing.
absl::Status WritePlanJson(const PlanDocument& document, const std::string& folder);
absl::Status WritePlanOutputs(PlanningSession& session, PlanDocument& document,
                              const OutputOptions& options);

}  // namespace sightline
