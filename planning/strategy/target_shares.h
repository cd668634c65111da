// SPDX-License-Identifier: Apache-2.0
// Information of scans about targets, as fractions of the information that the targets require.
//
// A fraction (share) of 1 satisfies a target; fractions of several scans add up. With coverage a
// scan gives a target all or nothing. With uncertainty the fraction is the scan's information over
// the information at which the target's uncertainty is admissible.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/targets/target_set.h"

namespace sightline {

// Fractions of the required information that one scan gives to targets.
struct TargetShares {
  std::vector<uint32_t> targets;  // ascending
  std::vector<float> share;       // > 0, one per entry of `targets`
};

// Fraction 1 for every target of the set.
TargetShares FullShares(const TargetBits& satisfied);

// Adds a scan's fractions to the accumulated information of all targets.
void AddShares(const TargetShares& scan, std::span<float> known);

// Targets of `measurable` with an accumulated fraction of at least 1.
TargetBits Satisfied(const TargetBits& measurable, std::span<const float> known);

// Worth of a target whose accumulated information reaches a threshold.
struct ShareStep {
  double weight = 1;
  std::vector<float> threshold;  // one per target, or one for all; > 0
  float of(size_t target) const { return threshold[threshold.size() == 1 ? 0 : target]; }
};

// Sum over targets of the weights of all steps that their accumulated information reaches.
double StepWorth(std::span<const ShareStep> steps, const TargetBits& measurable,
                 std::span<const float> known);

// Sum over the scan's targets of the worth that the scan adds to the accumulated information.
double StepGain(std::span<const ShareStep> steps, const TargetBits& measurable,
                std::span<const float> known, const TargetShares& scan);

}  // namespace sightline
