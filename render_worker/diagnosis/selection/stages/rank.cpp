// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cassert>
#include <cmath>
#include <utility>
#include <vector>

#include "render_worker/diagnosis/fit/model_error.h"
#include "render_worker/diagnosis/selection/stages/stages.h"
#include "render_worker/evidence/model_prior.h"

namespace sightline {
namespace {

double LogModelPrior(const HypothesisCounts& counts, const Hypothesis& hypothesis) {
  const ModelCounts models = {.effects = counts.effects, .discrepancy_terms = counts.free_forms};
  const int effects = static_cast<int>(hypothesis.effects.size());
  if (effects == 0) return LogPriorOfNoEffect();
  const auto terms =
      std::count_if(hypothesis.effects.begin(), hypothesis.effects.end(),
                    [](const ActiveEffect& active) { return IsFreeForm(*active.effect); });
  if (terms == 0) return LogPriorOfNamed(models, effects);
  return LogPriorOfDiscrepancy(models, effects > terms, static_cast<int>(terms));
}

}  // namespace

double EffectErrorOf(const SetModel& model) { return model.is_corrected() ? 0 : kEffectError; }

std::vector<double> TrustedEvidence(const std::vector<Hypothesis>& hypotheses,
                                    double effect_error_of_all) {
  double best = 0, single = 0, effect_error = effect_error_of_all;
  for (const Hypothesis& hypothesis : hypotheses) {
    best = std::max(best, hypothesis.log_evidence);
    if (hypothesis.effects.size() != 1 || hypothesis.log_evidence < single) continue;
    single = hypothesis.log_evidence;
    // A vibration with fitted phases is not an approximation of the recordings' changes.
    effect_error = hypothesis.phases_rad.empty() ? effect_error_of_all : 0;
  }
  const double weight = kEvidenceWeight / (1 + effect_error * effect_error * best);
  const double error = 2 * effect_error * effect_error * single;
  std::vector<double> trusted;
  for (const Hypothesis& hypothesis : hypotheses) {
    trusted.push_back(weight * hypothesis.log_evidence);
    if (hypothesis.effects.size() < 2 || IsFreeForm(hypothesis)) continue;
    const FitResult& fit = hypothesis.fit;
    const double misfit = std::max(1.0, fit.chi_squared / std::max(1, fit.data_count));
    const double more = hypothesis.log_evidence - single - error;
    trusted.back() = std::max(trusted.back(), weight * single + kEvidenceWeight / misfit * more);
  }
  return trusted;
}

std::vector<Hypothesis> RankHypotheses(const HypothesisCounts& counts,
                                       std::vector<Hypothesis> hypotheses, double effect_error) {
  assert(!hypotheses.empty());
  const std::vector<double> trusted_evidence = TrustedEvidence(hypotheses, effect_error);
  double largest = -1e300;
  for (size_t h = 0; h < hypotheses.size(); ++h) {
    Hypothesis& hypothesis = hypotheses[h];
    hypothesis.log_prior = LogModelPrior(counts, hypothesis);
    hypothesis.evidence.model_prior = hypothesis.log_prior - LogPriorOfNoEffect();
    hypothesis.probability = trusted_evidence[h] + hypothesis.log_prior;
    largest = std::max(largest, hypothesis.probability);
  }
  double sum = 0;
  for (Hypothesis& hypothesis : hypotheses) {
    hypothesis.probability = std::exp(hypothesis.probability - largest);
    sum += hypothesis.probability;
  }
  for (Hypothesis& hypothesis : hypotheses) hypothesis.probability /= sum;
  std::stable_sort(
      hypotheses.begin(), hypotheses.end(),
      [](const Hypothesis& a, const Hypothesis& b) { return a.probability > b.probability; });
  return hypotheses;
}

std::vector<Hypothesis> Rank(const Context& context, std::vector<Hypothesis> hypotheses) {
  std::erase_if(hypotheses, [](const auto& h) { return !EffectsAreDetected(h); });
  Hypothesis none;
  none.fit = context.null;
  hypotheses.push_back(std::move(none));
  return RankHypotheses(CountsOf(context.settings), std::move(hypotheses),
                        EffectErrorOf(context.model));
}

HypothesisCounts CountsOf(const ComparisonSettings& settings) {
  return {.effects = static_cast<int>(settings.effects.size()),
          .free_forms = static_cast<int>(settings.free_forms.size())};
}

}  // namespace sightline
