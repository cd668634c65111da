// SPDX-License-Identifier: Apache-2.0
// Makes the plan (poses, travel, numbers) from chosen scans.
#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"
#include "planner_client/commands/planning/session/planning_session.h"
#include "planning/strategy/planner.h"
#include "planning/strategy/scan_count_bound.h"
#include "sightline/v1/plan.pb.h"

namespace sightline {

struct PlanDocument {
  v1::Plan plan;
  std::vector<ChosenScan> scans;  // in the plan's order
  // Only for plans for uncertainty: exact uncertainty of all targets after all scans, and the
  // admissible uncertainty of every target [m] (0 if it is not toleranced).
  PosteriorUncertainties uncertainties;
  std::vector<float> admissible_uncertainty_m;
  // One reason per target that is not covered; empty until ExplainUncovered.
  std::vector<TargetReason> reasons;
  // One sentence for each picture, explanation or quality that the server did not give. The plan is
  // kept without it; the report and stderr list it.
  std::vector<std::string> missing;

  // Records that something, such as "picture of scan 3", is missing, and why.
  void Miss(const std::string& what, const absl::Status& why) {
    missing.push_back(absl::StrCat("missing: ", what, ": ", why.message()));
  }
};

struct PlanSource {
  std::string strategy;
  int64_t seed = 0;
  int64_t evaluations = 0;
  v1::Plan::StopReason stop_reason = v1::Plan::STOP_REASON_UNSPECIFIED;
};

v1::Plan::StopReason StopReasonToProto(StopReason reason);

// Orders the scans for least repositioning (unit costs: as they come) and fills in poses, travel,
// trigger positions, exact coverage, uncertainty and costs. Contains no time, host or date: the
// same scans give the same bytes. Errors of the coverage server are passed on.
absl::StatusOr<PlanDocument> MakePlanDocument(const PlanningSession& session,
                                              std::vector<ChosenScan> scans,
                                              const PlanSource& source);

// Adds the lower bounds on scans, set-ups and time to the coverage or uncertainty of the plan.
void SetBound(const PlanningSession& session, ScanCountBoundResult bound, v1::Plan& plan);

// One paragraph for the terminal.
std::string SummarisePlan(const v1::Plan& plan);

}  // namespace sightline
