// SPDX-License-Identifier: Apache-2.0
// Data that people and machines need to set up the scans of a plan: how well each measures, the
// set-up sheet and the exports.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "planner_client/commands/planning/document/plan_document.h"
#include "planner_client/commands/planning/session/planning_session.h"
#include "report/plan/report.h"

namespace sightline {

// Beside plan.json; report.html links to it.
inline constexpr char kSetUpSheetFile[] = "setup.html";

// From coordinates of the CAD model to those of the plan's poses, where the part lies as measured
// points found it.
Eigen::Isometry3f ToStage(const PlanningSession& session);

// Sets PlannedScan.quality of every scan that measures anything, from all of its points. Data that
// the coverage server does not give are missing in the document.
void AddScanQuality(const PlanningSession& session, PlanDocument& document);

// Depth per pixel of the targets that the plan covers (ReportData.depth_per_pixel_m).
std::vector<float> DepthPerPixel(const PlanningSession& session, const PlanDocument& document,
                                 const TargetSet& targets);

// setup.html and exports/, from the data of the report.
absl::Status WriteSetUpFiles(const ReportData& data, const std::string& folder);

}  // namespace sightline
