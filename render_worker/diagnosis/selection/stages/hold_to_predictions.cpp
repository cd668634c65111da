// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <utility>
#include <vector>

#include "render_worker/diagnosis/selection/stages/stages.h"
#include "render_worker/diagnosis/selection/thresholds.h"

namespace sightline {
namespace {

// Largest log score of the null model and of hypotheses with some but not all of the effects of
// `hypothesis`: it must improve on that.
double ScoreWithout(const Hypothesis& hypothesis, const std::vector<Hypothesis>& ranked,
                    const std::vector<double>& scores, double null_score) {
  double best = null_score;
  for (size_t h = 0; h < ranked.size(); ++h) {
    const Hypothesis& part = ranked[h];
    if (part.effects.empty() || part.effects.size() >= hypothesis.effects.size()) continue;
    const bool among = std::all_of(part.effects.begin(), part.effects.end(),
                                   [&](const auto& a) { return Has(hypothesis, a.effect); });
    if (among) best = std::max(best, scores[h]);
  }
  return best;
}

std::vector<Hypothesis> WithoutUnpredictive(const Context& context,
                                            const std::vector<Hypothesis>& ranked,
                                            double null_score) {
  std::vector<double> scores(ranked.size(), -1e300);
  for (size_t h = 0; h < ranked.size(); ++h) {
    if (!IsFreeForm(ranked[h])) scores[h] = CheckHypothesis(context, ranked[h]).log_score;
  }
  std::vector<Hypothesis> predictive;
  for (size_t h = 0; h < ranked.size(); ++h) {
    const bool named = !ranked[h].effects.empty() && !IsFreeForm(ranked[h]);
    if (named && !(scores[h] - ScoreWithout(ranked[h], ranked, scores, null_score) >
                   thresholds::kClearGain_nats)) {
      continue;
    }
    predictive.push_back(ranked[h]);
  }
  return RankHypotheses(CountsOf(context.settings), std::move(predictive));
}

// The model-discrepancy term of largest screened gain, without a strength, so that unknown physics
// has a stage though no term was worth a fit; empty if there is no term.
std::vector<Hypothesis> UnfittedTerm(const Context& context) {
  const ScreenedEffect* best = nullptr;
  for (const ScreenedEffect& screened : context.screened) {
    if (!IsFreeForm(*screened.strongest.effect)) continue;
    if (best == nullptr || screened.gain > best->gain) best = &screened;
  }
  if (best == nullptr) return {};
  Hypothesis term = MakeHypothesis({AtNullValues(*best->strongest.effect)});
  term.free.clear();
  term.fit = context.null;
  term.fit.parameters.effects = term.effects;
  return {term};
}

// `ranked` with the probability `unknown_probability` for all hypotheses with a model-discrepancy
// term together.
std::vector<Hypothesis> ShareWithUnknown(const Context& context, std::vector<Hypothesis> ranked,
                                         double unknown_probability) {
  std::vector<Hypothesis> known, unknown;
  for (Hypothesis& hypothesis : ranked) {
    (IsFreeForm(hypothesis) ? unknown : known).push_back(std::move(hypothesis));
  }
  if (unknown.empty()) unknown = UnfittedTerm(context);
  if (unknown.empty()) unknown_probability = 0;
  std::vector<Hypothesis> shared;
  const auto add = [&](std::vector<Hypothesis> hypotheses, double probability) {
    if (hypotheses.empty()) return;
    hypotheses = RankHypotheses(CountsOf(context.settings), std::move(hypotheses));
    for (Hypothesis& hypothesis : hypotheses) {
      hypothesis.probability *= probability;
      shared.push_back(std::move(hypothesis));
    }
  };
  add(std::move(known), 1 - unknown_probability);
  add(std::move(unknown), unknown_probability);
  std::stable_sort(shared.begin(), shared.end(), [](const Hypothesis& a, const Hypothesis& b) {
    return a.probability > b.probability;
  });
  return shared;
}

}  // namespace

ModelComparison HoldToPredictions(const Context& context, std::vector<Hypothesis> ranked) {
  ModelComparison result;
  Hypothesis none;
  none.fit = context.null;
  result.null_check = CheckHypothesis(context, none);
  result.named_check = result.null_check;
  ranked = WithoutUnpredictive(context, ranked, result.null_check.log_score);
  // The null model is always among them.
  const auto leading = std::find_if(ranked.begin(), ranked.end(),
                                    [](const auto& hypothesis) { return !IsFreeForm(hypothesis); });
  if (leading->effects.empty()) {
    result.named = std::move(none);
  } else {
    result.named = *leading;
    result.named_check = CheckHypothesis(context, *leading);
  }
  // Odds of unknown physics over the vocabulary.
  const double p_value = result.named_check.p_value;
  const double odds =
      thresholds::kUnknownPrior / (1 - thresholds::kUnknownPrior) * BayesFactorBound(p_value);
  double unknown = 0;
  for (const Hypothesis& hypothesis : ranked) {
    if (IsFreeForm(hypothesis)) unknown += hypothesis.probability;
  }
  const double least = odds / (1 + odds);
  if (p_value < thresholds::kRejectedBelow && unknown < least) {
    ranked = ShareWithUnknown(context, std::move(ranked), least);
  }
  result.ranked = std::move(ranked);
  return result;
}

}  // namespace sightline
