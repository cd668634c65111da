// SPDX-License-Identifier: Apache-2.0
// Worth of knowing targets, and the gain of a scan (thesis eq. 3.1, 3.2, 6.1, 6.3).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/inspection/inspection.h"
#include "core/targets/target_set.h"
#include "coverage_server/answers/scene_answers.h"
#include "coverage_server/uncertainty/target_priors.h"

namespace sightline {

// Made once for a batch of scans; holds the data needed per target.
class UncertaintyValue {
 public:
  // Targets that are not measurable are worth nothing. The arguments must outlive the value.
  UncertaintyValue(const TargetPriors& priors, const TargetBits& measurable,
                   const UncertaintyRequirement& requirement);

  // Sum over targets of their worth after the scan less that before.
  double Gain(const ScanInformation& scan, const TargetBits& covered_by_scan) const;
  // Number of targets that the scan makes admissible.
  int32_t NewAdmissible(const ScanInformation& scan) const;
  // Sum over targets of weight times min(1, density of the scan / density needed), as if nothing
  // were known.
  double WeightedShare(const ScanInformation& scan, std::span<const float> target_weights) const;

 private:
  struct Target {
    float known;       // density
    float admissible;  // density that makes it admissible; infinite: not toleranced
    float relaxed;     // density that makes it relaxed
    float worth;       // of what is known, without coverage
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
