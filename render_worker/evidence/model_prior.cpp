// SPDX-License-Identifier: Apache-2.0
#include "render_worker/evidence/model_prior.h"

#include <algorithm>
#include <cmath>

namespace sightline {

double LogPriorOfNoEffect() { return std::log(kPriorOfNoEffect); }

double LogPriorOfNamed(const ModelCounts& counts, int effects) {
  const double choices = counts.effects;
  return std::log((1 - kPriorOfNoEffect) * (1 - kPriorOfUnknown) / choices) +
         (effects - 1) * std::log(kPriorOfOneMore / choices);
}

double LogPriorOfDiscrepancy(const ModelCounts& counts, bool beside_named_effect, int terms) {
  const double share = beside_named_effect ? kPriorOfNearKnown * counts.stages / counts.effects
                                           : 1 - kPriorOfNearKnown;
  const double choices = std::max(1, counts.discrepancy_terms);
  return std::log((1 - kPriorOfNoEffect) * kPriorOfUnknown * share / choices) +
         (terms - 1) *
             std::log(kPriorOfOneMore * counts.stages / std::max<double>(counts.stages, choices));
}

}  // namespace sightline
