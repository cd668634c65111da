// SPDX-License-Identifier: Apache-2.0
// Reason why a target is not covered, as the coverage server reports it.
#pragma once

#include "sightline/v1/targets.pb.h"

namespace sightline {

struct TargetReason {
  v1::UncoveredReason reason = v1::UNCOVERED_REASON_UNSPECIFIED;  // of covered targets
  int obstacle = -1;  // index into the scene's obstacles if one is the reason
  // Too dark: shortest exposure that would show the line; too bright: longest one; infinite: none
  // would. 0 for other reasons.
  double exposure_time_s = 0;

  friend bool operator==(const TargetReason&, const TargetReason&) = default;
};

// Exposure times that are permitted, for the reasons of light.
struct ExposureLimits {
  double shortest_s = 0, longest_s = 0;
};

}  // namespace sightline
