// SPDX-License-Identifier: Apache-2.0
// Bounds the probability of a model by a significance test.
#pragma once

namespace sightline {

// Largest Bayes factor against a model that corresponds to a p-value: 1 / (-e p ln p) for p < 1/e,
// else 1 (Sellke, Bayarri and Berger, Am. Stat. 55 (2001) 62). `p_value` in [0, 1]; values below
// 1e-300 count as 1e-300.
double BayesFactorBound(double p_value);

// Probability of unknown physics after a test of the best named model: prior odds times the bound.
// In [0, 1).
double ProbabilityOfUnknown(double p_value);

}  // namespace sightline
