// SPDX-License-Identifier: Apache-2.0
// The scan with the largest gain for features that the measured points leave undecided.
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

// Plans one scan more on the part as it was found, for the targets of undecided features alone.
// Each of these is to be known to JudgedInspection::needed. Unset: no scan of the rig
// adds anything, or no target of these features can be measured. Errors of OpenSession are passed
// on.
absl::StatusOr<std::optional<v1::NextScan>> FindNextScan(const NextScanQuestion& question,
                                                         const EarlierPlan& earlier,
                                                         std::shared_ptr<const MeasuredPart> part,
                                                         const JudgedInspection& judged);

}  // namespace sightline
