// SPDX-License-Identifier: Apache-2.0
// Data to set up the scans of a plan: quality of each scan, the set-up sheet and the
// exports.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "planner_client/commands/planning/document/plan_document.h"
#include "planner_client/commands/planning/session/planning_session.h"
#include "report/plan/report.h"

namespace sightline {

// Beside plan.json; report.html links to it.
inline constexpr char kSetUpSheetFile[] = "setup.html";

// Transformation from CAD coordinates to those of the plan's poses, where the part lies as
// registered from measured points.
Eigen::Isometry3f ToStage(const PlanningSession& session);

// Sets PlannedScan.quality of every scan that measures anything, from all of its points. If the
// coverage server fails, the document lists the data as missing.
void AddScanQuality(const PlanningSession& session, PlanDocument& document);

// Depth per pixel of the targets that the plan covers (ReportData.depth_per_pixel_m).
std::vector<float> DepthPerPixel(const PlanningSession& session, const PlanDocument& document,
                                 const TargetSet& targets);

// setup.html and exports/, from the data of the report.
absl::Status WriteSetUpFiles(const ReportData& data, const std::string& folder);

}  // namespace sightline
