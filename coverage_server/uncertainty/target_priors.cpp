// SPDX-License-Identifier: Apache-2.0
#include "coverage_server/uncertainty/target_priors.h"

#include <algorithm>

namespace sightline {

double TargetPriors::smallest_length_scale_m() const {
  return std::min_element(
             priors.begin(), priors.end(),
             [](const auto& a, const auto& b) { return a.length_scale_m < b.length_scale_m; })
      ->length_scale_m;
}

double TargetPriors::largest_neighbourhood_m() const {
  double largest_m = 0;
  for (const SurfacePrior& prior : priors) {
    largest_m = std::max(largest_m, prior.neighbourhood_m());
  }
  return largest_m;
}

TargetPriors MakeTargetPriors(const TargetSet& targets, const TargetSampling& sampling,
                              const UncertaintyModel& model) {
  TargetPriors result;
  // The first prior is that of targets in no region, the others those of the regions in order.
  result.priors.push_back(
      {model.prior_standard_deviation_m, CovarianceLengthScale(model.resolution_m)});
  for (const TargetRegion& region : sampling.regions) {
    result.priors.push_back(
        {model.prior_standard_deviation_m,
         CovarianceLengthScale(region.resolution_m.value_or(model.resolution_m))});
  }
  result.prior_of.reserve(targets.size());
  for (const int32_t region : targets.regions) {
    result.prior_of.push_back(static_cast<uint16_t>(region + 1));
  }
  return result;
}

}  // namespace sightline
