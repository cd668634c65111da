// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <span>
#include <utility>
#include <vector>

#include "render_worker/diagnosis/random_effect/compare_random_effects.h"
#include "render_worker/diagnosis/selection/stages/stages.h"
#include "render_worker/diagnosis/selection/thresholds.h"

namespace sightline {
namespace {

// The likelihood ratio at its top and what integrating over the law's parameters leaves of it.
Evidence EvidenceOf(const RandomEffectCandidate& random) {
  return {.fit = random.largest_gain,
          .covariance = 0,
          .curvature = 0,
          .parameter_prior = random.log_evidence - random.largest_gain,
          .model_prior = 0};
}

// Realised light of every recording, or its movement if the light is constant.
std::vector<double> Realised(const RandomEffectCandidate& random) {
  const bool light = std::any_of(random.light_relative.begin(), random.light_relative.end(),
                                 [](double value) { return value != 0; });
  return light ? random.light_relative : random.shift_px;
}

// The vocabulary about the fit of a random effect. The residual contains the realised values; the
// expectation that other effects change does not.
ScreeningResult ScreenBeside(const Context& context, const Hypothesis& random) {
  FitResult about = random.fit;
  about.mean = context.model.Expect(about.parameters, false).mean;
  return ScreenNamed(context, Screening(context.model, about), 0.96);
}

// Effects that may be combined with `random`, fitted without it.
StageResult BasesBeside(const Context& context, const Hypothesis& random) {
  const ScreeningResult beside =
      NullIsRejected(context) ? ScreenBeside(context, random) : ScreeningResult{};
  if (beside.stopped) return {{}, true};
  std::vector<Hypothesis> bases;
  for (const JointEffect& joint : SortedByTotal(JointGains(context, random, beside.effects))) {
    if (bases.size() == thresholds::kRandomEffectBases) break;
    if (joint.gain < thresholds::kPairGain_nats) continue;
    bases.push_back(FitHypothesis(context, MakeHypothesis({joint.added}), context.null, {}));
    if (!std::isfinite(bases.back().log_evidence)) bases.pop_back();
  }
  return {std::move(bases)};
}

// The best single effects that are not random.
std::vector<Hypothesis> BestSingles(const std::vector<Hypothesis>& hypotheses) {
  std::vector<Hypothesis> bases;
  for (const Hypothesis& hypothesis : hypotheses) {
    if (bases.size() == thresholds::kRandomEffectBases ||
        hypothesis.log_evidence < thresholds::kPairGain_nats) {
      break;
    }
    const bool single = hypothesis.effects.size() == 1;
    if (single && !IsFreeForm(hypothesis) && !IsRandomEffect(hypothesis)) {
      bases.push_back(hypothesis);
    }
  }
  return bases;
}

}  // namespace

std::vector<Hypothesis> AddRandomEffects(const Context& context, std::vector<Hypothesis> hypotheses,
                                         const FitResult* best) {
  // If the best deterministic effect already makes repeated recordings of a position consistent,
  // there is no strong random effect left to look for.
  const bool perhaps_strong =
      hypotheses.empty() || IsRandomEffect(hypotheses.front()) ||
      RecordingsDifferStrongly(context.model, best != nullptr ? *best : hypotheses.front().fit);
  for (RandomEffectCandidate& random :
       CompareRandomEffects(context.model, context.null, context.random, perhaps_strong)) {
    Hypothesis hypothesis;
    hypothesis.effects = {{random.effect, random.parameters}};
    hypothesis.free = random.fit.free;
    SetEvidence(EvidenceOf(random), &hypothesis);
    hypothesis.fit = std::move(random.fit);
    hypothesis.realised = Realised(random);
    hypothesis.phases_rad = std::move(random.phases_rad);
    // A null model far from the data makes its linearisation wrong; the fit with the realised
    // values does not depend on it.
    if (NullIsRejected(context)) {
      const Evidence of_fit = EvidenceOver(hypothesis, context.null);
      if (of_fit.LogMarginalLikelihood() > hypothesis.log_evidence) {
        SetEvidence(of_fit, &hypothesis);
      }
    }
    hypotheses.push_back(std::move(hypothesis));
  }
  return SortedByEvidence(std::move(hypotheses));
}

bool RandomEffectLeads(const std::vector<Hypothesis>& hypotheses, const FitResult* best) {
  if (hypotheses.empty() || !IsRandomEffect(hypotheses.front())) return false;
  return best == nullptr || TwiceCost(hypotheses.front().fit) < TwiceCost(*best);
}

StageResult AddRandomEffectsBeside(const Context& context, std::vector<Hypothesis> hypotheses) {
  if (context.settings.max_effects < 2 || hypotheses.empty()) return {std::move(hypotheses)};
  if (!hypotheses.front().phases_rad.empty()) {
    return AddEffectsBesideVibration(context, std::move(hypotheses));
  }
  // A random effect that explains most is part of every pair.
  std::span<const Effect* const> effects = context.settings.effects;
  const Effect* const only =
      IsRandomEffect(hypotheses.front()) ? hypotheses.front().effects[0].effect : nullptr;
  if (only != nullptr) effects = {&only, 1};
  const StageResult bases = only != nullptr ? BasesBeside(context, hypotheses.front())
                                            : StageResult{BestSingles(hypotheses)};
  if (bases.stopped) return {std::move(hypotheses), true};
  // As in AddRandomEffects, for the best base.
  const bool perhaps_strong = !bases.hypotheses.empty() &&
                              RecordingsDifferStrongly(context.model, bases.hypotheses.front().fit);
  for (const Hypothesis& base : bases.hypotheses) {
    for (RandomEffectCandidate& random :
         CompareRandomEffects(context.model, base.fit, effects, perhaps_strong)) {
      if (random.log_evidence < thresholds::kPairGain_nats) continue;
      Hypothesis pair;
      pair.effects = random.fit.parameters.effects;
      pair.free = random.fit.free;
      SetEvidence(base.evidence + EvidenceOf(random), &pair);
      pair.realised = Realised(random);
      pair.fit = std::move(random.fit);
      hypotheses.push_back(std::move(pair));
    }
  }
  return {SortedByEvidence(std::move(hypotheses))};
}

}  // namespace sightline
