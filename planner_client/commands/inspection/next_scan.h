// SPDX-License-Identifier: Apache-2.0
// Finds the scan of largest gain for features that the measured points leave undecided.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "planner_client/commands/planning/replanning/as_measured_session.h"
#include "planner_client/inspect/judge_measured.h"
#include "planner_client/replanning/measured_part.h"
#include "sightline/v1/measured_result.pb.h"

namespace sightline {

struct NextScanQuestion {
  std::string inspection_file;
  std::string coverage_server;  // empty: an embedded server is started
  ServerTlsOptions tls;
  int64_t seed = 1;
  int64_t evaluations = 5000;
};

// Plans one further scan on the part as measured, only for the targets of undecided features. Each
// target needs the uncertainty in JudgedInspection::needed. Returns nothing if no scan of the rig
// adds information, or if no target of these features is measurable. Errors of OpenSession are
// passed on.
absl::StatusOr<std::optional<v1::NextScan>> FindNextScan(const NextScanQuestion& question,
                                                         const EarlierPlan& earlier,
                                                         std::shared_ptr<const MeasuredPart> part,
                                                         const JudgedInspection& judged);

}  // namespace sightline
