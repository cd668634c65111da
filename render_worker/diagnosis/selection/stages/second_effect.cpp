// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "render_worker/diagnosis/random_effect/compare_random_effects.h"
#include "render_worker/diagnosis/selection/stages/screen.h"
#include "render_worker/diagnosis/selection/stages/stages.h"
#include "render_worker/diagnosis/selection/terms/directed_test.h"
#include "render_worker/diagnosis/selection/thresholds.h"
#include "render_worker/evidence/judgement.h"

namespace sightline {
namespace {

// Puts `pair` in the place of a fit of the same effects that has less evidence, or at the end.
void Merge(Hypothesis pair, std::vector<Hypothesis>* hypotheses) {
  const auto known = std::find_if(hypotheses->begin(), hypotheses->end(), [&](const auto& h) {
    return h.effects.size() == pair.effects.size() &&
           std::all_of(h.effects.begin(), h.effects.end(),
                       [&](const ActiveEffect& active) { return Has(pair, active.effect); });
  });
  if (known == hypotheses->end()) {
    hypotheses->push_back(std::move(pair));
  } else if (pair.log_evidence > known->log_evidence) {
    *known = std::move(pair);
  }
}

}  // namespace

const Hypothesis* BestSingle(const std::vector<Hypothesis>& hypotheses) {
  const auto best = std::find_if(hypotheses.begin(), hypotheses.end(), [](const auto& h) {
    return h.effects.size() == 1 && !IsFreeForm(h) && !IsRandomEffect(h);
  });
  return best == hypotheses.end() ? nullptr : &*best;
}

bool NamedIsRejected(const Context& context, const std::vector<Hypothesis>& hypotheses) {
  const auto named = std::find_if(hypotheses.begin(), hypotheses.end(),
                                  [](const Hypothesis& h) { return !IsFreeForm(h); });
  return named == hypotheses.end() || CheckNamed(context, *named).p_value < kRejectedBelow;
}

StageResult AddSecondEffect(const Context& context, std::vector<Hypothesis> hypotheses) {
  const Hypothesis* best = BestSingle(hypotheses);
  if (best == nullptr || context.settings.max_effects < 2 || !NullIsRejected(context) ||
      !NamedIsRejected(context, hypotheses)) {
    return {std::move(hypotheses)};
  }
  const Hypothesis base = *best;
  const ScreeningResult about_base =
      ScreenNamed(context, Screening(context.model, base.fit), thresholds::kSecondEffectDone);
  if (about_base.stopped) return {std::move(hypotheses), true};
  size_t fitted = 0;
  for (const JointEffect& joint : SortedByTotal(JointGains(context, base, about_base.effects))) {
    if (fitted == thresholds::kSecondEffects || joint.gain < thresholds::kPairGain_nats) break;
    if (!context.proceed(thresholds::kSecondEffectDone)) return {std::move(hypotheses), true};
    std::vector<ActiveEffect> effects = base.effects;
    effects.push_back(joint.added);
    Hypothesis pair = MakeHypothesis(std::move(effects));
    pair.fit.parameters = base.fit.parameters;
    pair.fit.mean = base.fit.mean;
    pair = FitHypothesis(context, std::move(pair), context.linearisation, {true, 8});
    ++fitted;
    if (std::isfinite(pair.log_evidence)) Merge(std::move(pair), &hypotheses);
  }
  return {SortedByEvidence(std::move(hypotheses))};
}

}  // namespace sightline
