// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/selection/hypothesis.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <utility>

#include "absl/status/status.h"
#include "render_worker/diagnosis/random_effect/compare_random_effects.h"
#include "render_worker/diagnosis/selection/term_selection.h"
#include "render_worker/diagnosis/selection/thresholds.h"
#include "render_worker/effects/discrepancy/free_form.h"

namespace sightline {

namespace {

// Prior of the effects' parameters and of the choice of a term's coefficients, over the standard
// normal density at 0 for each fitted parameter.
double LogPrior(const Hypothesis& hypothesis) {
  double sum = 0;
  for (size_t e = 0; e < hypothesis.effects.size(); ++e) {
    const ActiveEffect& active = hypothesis.effects[e];
    for (const EffectParameter& parameter : active.effect->description().parameters) {
      const std::vector<double>& tried = parameter.discrete_values;
      if (!tried.empty()) sum -= std::log(static_cast<double>(tried.size()));
    }
    if (!IsFreeForm(*active.effect)) continue;
    const auto fitted =
        std::count_if(hypothesis.free.begin(), hypothesis.free.end(),
                      [&](const auto& free) { return free.effect == static_cast<int>(e); });
    sum += LogSelectionPrior(static_cast<int>(fitted),
                             static_cast<int>(active.effect->description().parameters.size()));
  }
  assert(hypothesis.fit.effect_standard_errors.size() == hypothesis.free.size());
  for (size_t f = 0; f < hypothesis.free.size(); ++f) {
    const FreeEffectParameter& free = hypothesis.free[f];
    const ActiveEffect& active = hypothesis.effects[free.effect];
    const EffectParameter& parameter = active.effect->description().parameters[free.parameter];
    sum += LogParameterPrior(parameter,
                             StandardisedParameter(parameter, active.parameters[free.parameter]),
                             hypothesis.fit.effect_standard_errors[f] / parameter.prior_scale);
  }
  return sum;
}

// Logarithm of |H| with the columns of the set-up's parameters, which come first, from
// `linearisation`.
double LogDeterminantAbout(const FitResult& fit, const FitResult& linearisation) {
  const auto effects = static_cast<Eigen::Index>(fit.free.size());
  const Eigen::Index known = fit.standardised.size() - effects;
  Eigen::MatrixXd information = fit.prior_weight.asDiagonal();
  for (size_t e = 0; e < fit.jacobian.size(); ++e) {
    Eigen::MatrixXd jacobian = fit.jacobian[e];
    jacobian.leftCols(known) = linearisation.jacobian[e].leftCols(known);
    information.noalias() += jacobian.transpose() * jacobian;
  }
  return 2 * information.llt().matrixLLT().diagonal().array().log().sum();
}

}  // namespace

Hypothesis MakeHypothesis(std::vector<ActiveEffect> effects) {
  // A single effect may be a model-discrepancy term, which has no place in the vocabulary's order.
  if (effects.size() > 1) {
    // OrderEffects fails only if an effect is there twice. Callers add one effect to a hypothesis
    // that does not have it (JointGains).
    [[maybe_unused]] const absl::Status ordered = OrderEffects(&effects);
    assert(ordered.ok());
  }
  Hypothesis hypothesis;
  hypothesis.effects = std::move(effects);
  hypothesis.free = FreeParameters(hypothesis.effects);
  return hypothesis;
}

bool Has(const Hypothesis& hypothesis, const Effect* effect) {
  return std::any_of(hypothesis.effects.begin(), hypothesis.effects.end(),
                     [&](const ActiveEffect& active) { return active.effect == effect; });
}

bool IsFreeForm(const Effect& effect) {
  return FindFreeFormTerm(effect.description().id) != nullptr;
}

bool IsFreeForm(const Hypothesis& hypothesis) {
  return std::any_of(hypothesis.effects.begin(), hypothesis.effects.end(),
                     [](const ActiveEffect& active) { return IsFreeForm(*active.effect); });
}

bool IsRandomEffect(const Hypothesis& hypothesis) {
  return !hypothesis.effects.empty() && HasRandomLaw(*hypothesis.effects[0].effect);
}

bool EffectsAreDetected(const Hypothesis& hypothesis) {
  if (hypothesis.effects.size() < 2 || IsFreeForm(hypothesis)) return true;
  std::vector<bool> fitted(hypothesis.effects.size()), detected(hypothesis.effects.size());
  for (size_t f = 0; f < hypothesis.free.size(); ++f) {
    const auto [effect, parameter] = hypothesis.free[f];
    const ActiveEffect& active = hypothesis.effects[effect];
    const double from_null = active.parameters[parameter] -
                             active.effect->description().parameters[parameter].null_value;
    fitted[effect] = true;
    if (std::abs(from_null) >
        thresholds::kDetected_standard_errors * hypothesis.fit.effect_standard_errors[f]) {
      detected[effect] = true;
    }
  }
  for (size_t e = 0; e < fitted.size(); ++e) {
    if (fitted[e] && !detected[e]) return false;
  }
  return true;
}

Evidence EvidenceOver(const Hypothesis& hypothesis, const FitResult& null) {
  const FitResult& fit = hypothesis.fit;
  return {.fit = -0.5 * (fit.chi_squared - null.chi_squared),
          .covariance = -0.5 * (fit.data_log_determinant - null.data_log_determinant),
          .curvature = -0.5 * (fit.log_determinant - null.log_determinant),
          .parameter_prior = -0.5 * (fit.prior - null.prior) + LogPrior(hypothesis),
          .model_prior = 0};
}

Evidence EvidenceOver(const Hypothesis& hypothesis, const FitResult& null,
                      const FitResult& linearisation) {
  Evidence evidence = EvidenceOver(hypothesis, null);
  evidence.curvature = -0.5 * (LogDeterminantAbout(hypothesis.fit, linearisation) -
                               LogDeterminantAbout(null, linearisation));
  return evidence;
}

void SetEvidence(const Evidence& evidence, Hypothesis* hypothesis) {
  hypothesis->evidence = evidence;
  hypothesis->log_evidence = evidence.LogMarginalLikelihood();
}

}  // namespace sightline
