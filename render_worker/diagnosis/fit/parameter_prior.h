// SPDX-License-Identifier: Apache-2.0
// Priors of the effects' parameters.
//
// A fit works with standardised parameters: on their scale the prior is standard normal around the
// null value, 0. A quantity whose null value is a typical positive value is standardised
// logarithmically. While a parameter is fitted, the normal prior gets the tails of a Cauchy
// distribution, so that the prior does not shrink a strong effect.
#pragma once

#include "render_worker/effects/effect.h"

namespace sightline {

// `value`: in the parameter's unit, not below EffectParameter::lower.
double StandardisedParameter(const EffectParameter& parameter, double value);
// The inverse; the result is clamped to the parameter's physical bounds.
double ParameterFromStandardised(const EffectParameter& parameter, double standardised);

// Twice the negative logarithm of the prior density at z over that at 0: z^2 for |z| <= 1 and
// 1 + 2 log((1 + z^2) / 2) beyond. Value and slope are continuous at |z| = 1.
double FitPenalty(double standardised);
// The weight w with which the derivative of FitPenalty is 2 w z: 1 for |z| <= 1, else
// 2 / (1 + z^2). Iteratively reweighted least squares uses it as the prior's information.
double FitPriorWeight(double standardised);

}  // namespace sightline
