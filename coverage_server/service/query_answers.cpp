// SPDX-License-Identifier: Apache-2.0
#include "coverage_server/service/query_answers.h"

#include "absl/strings/str_cat.h"
#include "proto/status/rpc_status.h"

namespace sightline {

v1::Feasibility FeasibilityToProto(Feasibility feasibility) {
  switch (feasibility) {
    case Feasibility::kFeasible:
      return v1::FEASIBILITY_FEASIBLE;
    case Feasibility::kCollision:
      return v1::FEASIBILITY_COLLISION;
    case Feasibility::kTravel:
      return v1::FEASIBILITY_TRAVEL;
    case Feasibility::kOutOfBounds:
      return v1::FEASIBILITY_OUT_OF_BOUNDS;
  }
  return v1::FEASIBILITY_UNSPECIFIED;
}

absl::Status InfeasibleScan(const std::string& field, Feasibility feasibility) {
  const std::string reason = v1::Feasibility_Name(FeasibilityToProto(feasibility));
  return WithErrorInfo(
      absl::FailedPreconditionError(absl::StrCat(field, ": the scan is not feasible: ", reason)),
      "SCAN_INFEASIBLE", {{"feasibility", reason}});
}

}  // namespace sightline
