// SPDX-License-Identifier: Apache-2.0
// Two steps of the model comparison: a model-discrepancy term is added beside the best single
// effect, and coefficients that the term does not need are dropped.
#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cstddef>
#include <optional>
#include <utility>
#include <vector>

#include "render_worker/diagnosis/fit/linear_fit.h"
#include "render_worker/diagnosis/random_effect/compare_random_effects.h"
#include "render_worker/diagnosis/selection/stages/stages.h"
#include "render_worker/diagnosis/selection/term_selection.h"
#include "render_worker/diagnosis/selection/terms/directed_test.h"
#include "render_worker/diagnosis/selection/thresholds.h"
#include "render_worker/evidence/judgement.h"

namespace sightline {
namespace {

// Adds `term` to the single effect of `best`. The coefficients are not fitted: they maximise the
// gain in the linearised model. Returns nothing if that gain is below kPairGain_nats.
std::optional<Hypothesis> WithTerm(const Context& context, const Hypothesis& best,
                                   const LinearFit& linear, const Effect& term) {
  const auto& parameters = term.description().parameters;
  const auto n = static_cast<Eigen::Index>(parameters.size());
  Hypothesis hypothesis = best;
  hypothesis.effects.push_back(AtNullValues(term));
  std::vector<Eigen::VectorXd> slopes;
  Eigen::MatrixXd information = Eigen::MatrixXd::Identity(n, n);
  Eigen::VectorXd gradient(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    SetParameters moved = best.fit.parameters;
    moved.effects = hypothesis.effects;
    moved.effects[1].parameters[i] =
        ParameterFromStandardised(parameters[i], thresholds::kTermProbe);
    slopes.push_back(linear.Change(context.model.Expect(moved, false).mean) /
                     thresholds::kTermProbe);
    gradient[i] = linear.residual().dot(slopes[i]);
    for (Eigen::Index j = 0; j <= i; ++j) {
      const double inner = linear.Inner(slopes[i], slopes[j]);
      information(i, j) += inner;
      if (i != j) information(j, i) += inner;
    }
  }
  const Eigen::VectorXd z = information.llt().solve(gradient);
  if (0.5 * z.dot(gradient) < thresholds::kPairGain_nats) return std::nullopt;
  for (Eigen::Index i = 0; i < n; ++i) {
    hypothesis.effects[1].parameters[i] = ParameterFromStandardised(parameters[i], z[i]);
  }
  hypothesis.free = FreeParameters(hypothesis.effects);
  return hypothesis;
}

// Fitted with the coefficients of its term that SelectCoefficients chooses; empty if these are all
// of them, or if the evidence is expected to stay below `least`.
std::optional<Hypothesis> WithFewerCoefficients(const Context& context,
                                                const Hypothesis& hypothesis, double least) {
  const auto first =
      hypothesis.fit.standardised.size() - static_cast<Eigen::Index>(hypothesis.free.size());
  std::vector<int> coefficients;  // indices into `standardised`
  std::vector<size_t> places;     // the same in `free`
  std::vector<EffectParameter> parameters;
  for (size_t f = 0; f < hypothesis.free.size(); ++f) {
    const ActiveEffect& active = hypothesis.effects[hypothesis.free[f].effect];
    if (!IsFreeForm(*active.effect)) continue;
    coefficients.push_back(static_cast<int>(first) + static_cast<int>(f));
    places.push_back(f);
    parameters.push_back(active.effect->description().parameters[hypothesis.free[f].parameter]);
  }
  const TermSelection selection =
      SelectCoefficients(hypothesis.fit.standardised, hypothesis.fit.covariance,
                         hypothesis.fit.prior_weight, coefficients, parameters);
  if (selection.log_evidence_gain <= 0 ||
      hypothesis.log_evidence + selection.log_evidence_gain < least) {
    return std::nullopt;
  }
  Hypothesis simpler = hypothesis;
  for (size_t f = 0; f < hypothesis.free.size(); ++f) {
    const auto [effect, parameter] = hypothesis.free[f];
    const EffectParameter& described =
        hypothesis.effects[effect].effect->description().parameters[parameter];
    simpler.effects[effect].parameters[parameter] = ParameterFromStandardised(
        described, selection.standardised[first + static_cast<Eigen::Index>(f)]);
  }
  for (size_t k = places.size(); k-- > 0;) {
    if (!selection.needed[k]) {
      simpler.free.erase(simpler.free.begin() + static_cast<std::ptrdiff_t>(places[k]));
    }
  }
  simpler.fit.parameters =
      AtStandardised(context.model, hypothesis.fit.parameters, selection.standardised);
  return FitHypothesis(context, std::move(simpler), hypothesis.fit, {});
}

}  // namespace

StageResult AddTermsBeside(const Context& context, std::vector<Hypothesis> hypotheses) {
  const Hypothesis* leading = BestSingle(hypotheses);
  if (leading == nullptr || leading->log_evidence < thresholds::kPromising_nats) {
    return {std::move(hypotheses)};
  }
  const bool rejected = CheckNamed(context, hypotheses.front()).p_value < kRejectedBelow;
  if (!rejected && leading != hypotheses.data()) return {std::move(hypotheses)};
  const Hypothesis best = *leading;
  const LinearFit linear(best.fit);
  for (const Effect* term : context.settings.free_forms) {
    // If no named effect describes the recordings, the term may belong to any stage.
    const bool near = term->description().stage == best.effects[0].effect->description().stage;
    if (HasRandomLaw(*term) || (!near && !rejected)) continue;
    if (!context.proceed(0.99)) return {std::move(hypotheses), true};
    std::optional<Hypothesis> with_term = WithTerm(context, best, linear, *term);
    if (!with_term) continue;
    hypotheses.push_back(FitHypothesis(context, *std::move(with_term), best.fit, {false, 6}));
  }
  return {SortedByEvidence(std::move(hypotheses))};
}

std::vector<Hypothesis> DropCoefficients(const Context& context,
                                         std::vector<Hypothesis> hypotheses) {
  if (hypotheses.empty()) return hypotheses;
  const double least = hypotheses.front().log_evidence - thresholds::kSelectedBehind_nats;
  int selected = 0;
  for (Hypothesis& hypothesis : hypotheses) {
    const auto terms = std::count_if(hypothesis.effects.begin(), hypothesis.effects.end(),
                                     [](const auto& active) { return IsFreeForm(*active.effect); });
    if (terms != 1 || IsRandomEffect(hypothesis)) continue;
    std::optional<Hypothesis> simpler = WithFewerCoefficients(context, hypothesis, least);
    if (!simpler) continue;
    if (simpler->log_evidence > hypothesis.log_evidence) hypothesis = *std::move(simpler);
    if (++selected == thresholds::kSelected) break;
  }
  return SortedByEvidence(std::move(hypotheses));
}

}  // namespace sightline
