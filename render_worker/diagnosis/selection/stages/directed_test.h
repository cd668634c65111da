// SPDX-License-Identifier: Apache-2.0
// Test of a named model along the discrepancies that a stage of the image chain could have.
#pragma once

#include "render_worker/diagnosis/selection/context.h"

namespace sightline {

// Smallest p-value of the score tests along the model-discrepancy terms of each stage, times the
// number of stages (Bonferroni's correction), at most 1. 1 for a model whose random effect has
// realised values or phases, since its residuals are not those of its expectation.
// The whitened change from the null model to `hypothesis` has a relative error of kEffectError in
// every observation block, unless the expectation is corrected by renderings.
PredictedGroup TestAlongStages(const Context& context, const Hypothesis& hypothesis);

// CheckHypothesis; for a model with named effects that it does not reject, TestAlongStages is added
// to it.
PredictiveCheck CheckNamed(const Context& context, const Hypothesis& hypothesis);

}  // namespace sightline
