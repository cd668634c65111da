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

double LogPriorOfDiscrepancy(const ModelCounts& counts, bool beside_named_effect) {
  const double share = beside_named_effect ? kPriorOfNearKnown * counts.stages / counts.effects
                                           : 1 - kPriorOfNearKnown;
  return std::log((1 - kPriorOfNoEffect) * kPriorOfUnknown * share /
                  std::max(1, counts.discrepancy_terms));
}

}  // namespace sightline
