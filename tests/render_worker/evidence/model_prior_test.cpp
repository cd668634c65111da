// SPDX-License-Identifier: Apache-2.0
#include "render_worker/evidence/model_prior.h"

#include <gtest/gtest.h>

#include <cmath>

namespace sightline {
namespace {

// No effect, one effect, a term by itself and a term beside an effect of its own stage share the
// whole prior; further effects take theirs from evidence, as their number is open.
TEST(ModelPrior, SharesOutTheWhole) {
  const ModelCounts counts{.effects = 66, .discrepancy_terms = 42, .stages = 6};
  const double none = std::exp(LogPriorOfNoEffect());
  const double single = counts.effects * std::exp(LogPriorOfNamed(counts, 1));
  const double alone = counts.discrepancy_terms * std::exp(LogPriorOfDiscrepancy(counts, false));
  // Every term has counts.effects / counts.stages effects of its stage on average.
  const double beside = counts.discrepancy_terms * counts.effects / counts.stages *
                        std::exp(LogPriorOfDiscrepancy(counts, true));
  EXPECT_NEAR(none + single + alone + beside, 1, 1e-12);
}

TEST(ModelPrior, OneMoreEffectIsLessProbable) {
  const ModelCounts counts{.effects = 10, .discrepancy_terms = 4};
  EXPECT_LT(LogPriorOfNamed(counts, 2), LogPriorOfNamed(counts, 1));
  EXPECT_NEAR(LogPriorOfNamed(counts, 3) - LogPriorOfNamed(counts, 2),
              LogPriorOfNamed(counts, 2) - LogPriorOfNamed(counts, 1), 1e-12);
}

}  // namespace
}  // namespace sightline
