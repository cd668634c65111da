// SPDX-License-Identifier: Apache-2.0
// What scans tell of targets, as parts of what the targets need.
//
// A share of 1 settles a target; shares of several scans add up. Covering is the case in which
// every scan brings a target all or nothing; for uncertainty it is the information that the scan
// brings over the information after which the target's uncertainty is admissible.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/targets/target_set.h"

namespace sightline {

// Of one scan.
struct TargetShares {
  std::vector<uint32_t> targets;  // ascending
  std::vector<float> share;       // > 0, one per entry of `targets`
};

// Shares of 1 for every target of the set.
TargetShares FullShares(const TargetBits& settled);

// Adds a scan's shares to those of all targets.
void AddShares(const TargetShares& scan, std::span<float> known);

// Targets of `judged` with a share of at least 1.
TargetBits Settled(const TargetBits& judged, std::span<const float> known);

// What it is worth that a target's share reaches a threshold.
struct ShareStep {
  double weight = 1;
  std::vector<float> threshold;  // one per target, or one for all; > 0
  float of(size_t target) const { return threshold[threshold.size() == 1 ? 0 : target]; }
};

// Sum over targets of the weights of the steps that their shares reach.
double StepWorth(std::span<const ShareStep> steps, const TargetBits& judged,
                 std::span<const float> known);

// Sum over the scan's targets of what its shares add to the worth of what is known.
double StepGain(std::span<const ShareStep> steps, const TargetBits& judged,
                std::span<const float> known, const TargetShares& scan);

}  // namespace sightline
