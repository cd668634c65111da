// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/fit/parameter_prior.h"

#include <algorithm>
#include <cmath>

namespace sightline {

namespace {

// Floor of a logarithmic parameter relative to its null value. It keeps the logarithm finite where
// the lower bound is 0, and lies further below the null value than any prior scale reaches.
constexpr double kLogarithmFloor = 1e-6;

// True for a positive quantity whose null value is a typical value and not zero.
bool IsLogarithmic(const EffectParameter& p) { return p.null_value > 0 && p.lower >= 0; }
// Standard deviation of the logarithm: one prior scale above the null value is one unit.
double LogScale(const EffectParameter& p) { return std::log1p(p.prior_scale / p.null_value); }

}  // namespace

double StandardisedParameter(const EffectParameter& parameter, double value) {
  if (IsLogarithmic(parameter)) {
    return std::log(std::max(value, kLogarithmFloor * parameter.null_value) /
                    parameter.null_value) /
           LogScale(parameter);
  }
  return (value - parameter.null_value) / parameter.prior_scale;
}

double ParameterFromStandardised(const EffectParameter& parameter, double standardised) {
  const double value = IsLogarithmic(parameter)
                           ? parameter.null_value * std::exp(standardised * LogScale(parameter))
                           : parameter.null_value + standardised * parameter.prior_scale;
  return std::clamp(value, parameter.lower, parameter.upper);
}

double FitPenalty(double standardised) {
  const double square = standardised * standardised;
  return square <= 1 ? square : 1 + 2 * std::log((1 + square) / 2);
}

double FitPriorWeight(double standardised) {
  return 2 / (1 + std::max(1.0, standardised * standardised));
}

}  // namespace sightline
