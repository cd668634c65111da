// SPDX-License-Identifier: Apache-2.0
// Bounds the probability of a model by a significance test.
#pragma once

namespace sightline {

// Largest Bayes factor against a model that a p-value can stand for: 1 / (-e p ln p) for p < 1/e,
// else 1 (Sellke, Bayarri and Berger, Am. Stat. 55 (2001) 62). `p_value` in [0, 1]; below 1e-300 it
// counts as that.
double BayesFactorBound(double p_value);

// Probability of unknown physics after a test of the best named model: odds of the prior times the
// bound. In [0, 1).
double ProbabilityOfUnknown(double p_value);

}  // namespace sightline
