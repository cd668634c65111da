// SPDX-License-Identifier: Apache-2.0
// Test of a named model along the model-discrepancy terms.
#pragma once

#include "render_worker/diagnosis/selection/context.h"

namespace sightline {

// Smallest p-value of the score tests along the model-discrepancy terms of all stages, times the
// number of terms that the recordings show (Bonferroni's correction), at most 1. A test has as many
// degrees of freedom as its term has coefficients: one along all terms of a stage would have some
// thirty and miss what a single term describes. 1 for a model whose random effect has realised
// values or phases, since its residuals are not those of its expectation.
// The whitened change from the null model to `hypothesis` has a relative error of kEffectError in
// every observation block, unless the expectation is corrected by renderings.
PredictedGroup TestAlongTerms(const Context& context, const Hypothesis& hypothesis);

// CheckHypothesis; for a model with named effects that it does not reject, TestAlongTerms is added
// to it.
PredictiveCheck CheckNamed(const Context& context, const Hypothesis& hypothesis);

}  // namespace sightline
