// SPDX-License-Identifier: Apache-2.0
// Value of information about targets, and the gain of a scan (thesis eq. 3.1, 3.2, 6.1, 6.3).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/inspection/inspection.h"
#include "core/targets/target_set.h"
#include "coverage_server/answers/scene_answers.h"
#include "coverage_server/uncertainty/target_priors.h"

namespace sightline {

// Made once per batch of scans; holds the required data of every target.
class UncertaintyValue {
 public:
  // Targets that are not measurable have the value 0. The arguments must outlive this object.
  UncertaintyValue(const TargetPriors& priors, const TargetBits& measurable,
                   const UncertaintyRequirement& requirement);

  // Sum over targets of the value after the scan minus the value before.
  double Gain(const ScanInformation& scan, const TargetBits& covered_by_scan) const;
  // Number of targets that the scan makes admissible.
  int32_t NewAdmissible(const ScanInformation& scan) const;
  // Sum over targets of weight times min(1, density of the scan / required density), without
  // information of earlier scans.
  double WeightedShare(const ScanInformation& scan, std::span<const float> target_weights) const;

 private:
  struct Target {
    float known;       // density
    float admissible;  // density that makes it admissible; infinite: not toleranced
    float relaxed;     // density that makes it relaxed
    float worth;       // value of the accumulated information, without coverage
  };
  float Worth(const Target& target, float density, size_t index) const;
  float Unsettled(size_t index, float density) const;

  const TargetPriors& priors_;
  const TargetBits& measurable_;
  GainWeights weights_;
  std::span<const float> admissible_uncertainty_m_;
  std::vector<Target> targets_;
  const TargetBits* covered_;
};

}  // namespace sightline
