// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <utility>
#include <vector>

#include "render_worker/diagnosis/fit/fit_quality.h"
#include "render_worker/diagnosis/fit/model_error.h"
#include "render_worker/diagnosis/selection/stages/stages.h"
#include "render_worker/diagnosis/selection/terms/directed_test.h"
#include "render_worker/diagnosis/selection/thresholds.h"
#include "render_worker/evidence/judgement.h"

namespace sightline {
namespace {

ModelKind KindOf(const Hypothesis& hypothesis) {
  if (hypothesis.effects.empty()) return ModelKind::kNoEffect;
  return IsFreeForm(hypothesis) ? ModelKind::kDiscrepancy : ModelKind::kNamed;
}

// True if `part` has some but not all of the effects of `hypothesis`, and no other ones.
bool IsPartOf(const Hypothesis& part, const Hypothesis& hypothesis) {
  return part.effects.size() < hypothesis.effects.size() &&
         std::all_of(part.effects.begin(), part.effects.end(),
                     [&](const ActiveEffect& active) { return Has(hypothesis, active.effect); });
}

// All but the excess on recordings left out.
std::vector<ComparedModel> Compared(const Context& context,
                                    const std::vector<Hypothesis>& hypotheses) {
  const std::vector<double> trusted = TrustedEvidence(hypotheses, EffectErrorOf(context.model));
  std::vector<ComparedModel> models;
  for (size_t h = 0; h < hypotheses.size(); ++h) {
    ComparedModel model = {.kind = KindOf(hypotheses[h]),
                           .parts = {},
                           .log_evidence = trusted[h],
                           .log_prior = hypotheses[h].log_prior,
                           .held_out_score = hypotheses[h].held_out_score};
    for (size_t part = 0; part < hypotheses.size(); ++part) {
      if (IsPartOf(hypotheses[part], hypotheses[h])) model.parts.push_back(static_cast<int>(part));
    }
    models.push_back(std::move(model));
  }
  return models;
}

std::vector<Hypothesis> ThoseThatPredict(const Context& context,
                                         const std::vector<Hypothesis>& hypotheses) {
  const std::vector<bool> predicting = Predicting(Compared(context, hypotheses));
  std::vector<Hypothesis> kept;
  for (size_t h = 0; h < hypotheses.size(); ++h) {
    if (predicting[h]) kept.push_back(hypotheses[h]);
  }
  return RankHypotheses(CountsOf(context.settings), std::move(kept), EffectErrorOf(context.model));
}

// Chi squared over its degrees of freedom on recordings left out, minus 1.
double HeldOutExcess(const Context& context, const Hypothesis& hypothesis) {
  const PredictedFit fit = CrossValidate(context.model, hypothesis.fit, context.settings.seed);
  return fit.chi_squared / std::max(1, fit.degrees_of_freedom) - 1;
}

}  // namespace

bool ModelErrorsCount(const Context& context, const Hypothesis& hypothesis) {
  if (context.model.is_corrected()) return false;
  double squares = 0;
  for (size_t e = 0; e < hypothesis.fit.mean.size(); ++e) {
    squares += (*hypothesis.fit.whitening)(static_cast<int>(e),
                                           hypothesis.fit.mean[e] - context.null.mean[e])
                   .squaredNorm();
  }
  return kEffectError * kEffectError * squares > thresholds::kErrorWorthRendering;
}

ModelComparison HoldToPredictions(const Context& context, std::vector<Hypothesis> ranked) {
  for (Hypothesis& hypothesis : ranked) {
    hypothesis.held_out_score = CheckHypothesis(context, hypothesis).log_score;
  }
  ranked = ThoseThatPredict(context, ranked);
  std::vector<ComparedModel> models = Compared(context, ranked);
  const int named = BestNamed(models);
  const auto none =
      std::find_if(ranked.begin(), ranked.end(), [](const auto& h) { return h.effects.empty(); }) -
      ranked.begin();
  models[none].held_out_excess = HeldOutExcess(context, ranked[none]);
  models[named].held_out_excess = HeldOutExcess(context, ranked[named]);

  ModelComparison result;
  result.null_check = CheckHypothesis(context, ranked[none]);
  result.named = ranked[named];
  result.named_check = CheckNamed(context, ranked[named]);
  result.share_names_may_leave =
      ModelErrorsCount(context, result.named) ? kShareNamesMayLeave : kShareExactNamesMayLeave;
  const Judgement judgement =
      Judge(models, result.named_check.p_value, result.share_names_may_leave);
  for (size_t h = 0; h < ranked.size(); ++h) ranked[h].probability = judgement.probability[h];
  if (judgement.remainder) {
    const int term = judgement.remainder->discrepancy;
    result.remainder = {.term = term < 0 ? nullptr : ranked[term].effects.back().effect,
                        .share = judgement.remainder->share,
                        .probability = judgement.remainder->probability,
                        .small_share_decides = judgement.remainder->small_share_decides};
  }
  std::stable_sort(ranked.begin(), ranked.end(), [](const Hypothesis& a, const Hypothesis& b) {
    return a.probability > b.probability;
  });
  result.ranked = std::move(ranked);
  return result;
}

}  // namespace sightline
