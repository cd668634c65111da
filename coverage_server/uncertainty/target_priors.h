// SPDX-License-Identifier: Apache-2.0
// Prior distribution of the surface at every target, before any scan.
#pragma once

#include <cstdint>
#include <vector>

#include "core/surface_inference/surface_inference.h"
#include "core/targets/target_set.h"
#include "core/uncertainty/uncertainty_model.h"

namespace sightline {

// Targets of one resolution share a prior: `priors[prior_of[t]]` is that of target t.
struct TargetPriors {
  std::vector<SurfacePrior> priors;
  std::vector<uint16_t> prior_of;

  const SurfacePrior& of(size_t target) const { return priors[prior_of[target]]; }
  // Length scale of the finest resolution.
  double smallest_length_scale_m() const;
  double largest_neighbourhood_m() const;
};

// Resolutions come from the model and from the regions that state one.
TargetPriors MakeTargetPriors(const TargetSet& targets, const TargetSampling& sampling,
                              const UncertaintyModel& model);

}  // namespace sightline
