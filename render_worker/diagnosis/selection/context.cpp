// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/selection/context.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include "render_worker/diagnosis/random_effect/compare_random_effects.h"
#include "render_worker/diagnosis/random_effect/setup_independence.h"
#include "render_worker/diagnosis/selection/thresholds.h"

namespace sightline {

Context MakeContext(const SetModel& model, const FitResult& null,
                    const ComparisonSettings& settings,
                    const std::function<bool(double)>& progress) {
  Context context{model, settings, progress, {}, {}, {}, null, null};
  for (const std::span<const Effect* const> effects : {settings.effects, settings.free_forms}) {
    for (const Effect* effect : effects) {
      (HasRandomLaw(*effect) ? context.random : context.expected).push_back(effect);
    }
  }
  return context;
}

bool NullIsRejected(const Context& context) {
  return context.null.chi_squared > thresholds::kRejected * context.null.data_count;
}

Hypothesis FitHypothesis(const Context& context, Hypothesis hypothesis, const FitResult& reference,
                         const FitEffort& effort) {
  SetParameters start =
      hypothesis.fit.mean.empty() ? reference.parameters : hypothesis.fit.parameters;
  start.effects = hypothesis.effects;
  FitSettings settings;
  settings.rounds.clear();
  settings.renew_jacobian = effort.renew_jacobian;
  settings.max_iterations = effort.max_iterations;
  hypothesis.fit = FitSet(context.model, start, hypothesis.free, settings, &reference);
  hypothesis.effects = hypothesis.fit.parameters.effects;
  SetEvidence(EvidenceOver(hypothesis, context.null, context.linearisation), &hypothesis);
  return hypothesis;
}

Hypothesis FitFromNominal(const Context& context, Hypothesis hypothesis) {
  SetParameters start;
  start.effects = hypothesis.effects;
  start.line_shift_px = EstimateLineShifts(context.model, start);
  FitSettings settings;
  // Chosen: as FitSettings, with wide tolerances first, since the start is far off.
  settings.rounds = {{0.3, 0.3}, {0.1, 0.2}, {0.01, 0.1}, {0, 0.03}, {0, 0}};
  settings.middle_only = true;
  hypothesis.fit = FitSet(context.model, start, hypothesis.free, settings, nullptr);
  hypothesis.effects = hypothesis.fit.parameters.effects;
  SetEvidence(EvidenceOver(hypothesis, context.null), &hypothesis);
  return hypothesis;
}

std::vector<Hypothesis> SortedByEvidence(std::vector<Hypothesis> hypotheses) {
  std::erase_if(hypotheses, [](const auto& h) { return !std::isfinite(h.log_evidence); });
  std::stable_sort(
      hypotheses.begin(), hypotheses.end(),
      [](const Hypothesis& a, const Hypothesis& b) { return a.log_evidence > b.log_evidence; });
  return hypotheses;
}

PredictiveCheck CheckHypothesis(const Context& context, const Hypothesis& hypothesis) {
  PredictiveCheck check =
      CheckPredictions(context.model, hypothesis.fit, context.null, context.settings.seed);
  if (hypothesis.realised.empty()) return check;
  PredictedGroup independence;
  independence.name = "independence of the set-up";
  independence.p_value =
      SetupIndependencePValue(context.model.set(), hypothesis.realised, context.settings.seed);
  AddTest(independence, &check);
  return check;
}

}  // namespace sightline
