// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/selection/compare_models.h"

#include <optional>
#include <utility>
#include <vector>

#include "render_worker/diagnosis/selection/context.h"
#include "render_worker/diagnosis/selection/stages/screen.h"
#include "render_worker/diagnosis/selection/stages/stages.h"

namespace sightline {
namespace {

ModelComparison Finish(Context context, ModelComparison result) {
  result.null = std::move(context.null);
  result.screened = std::move(context.screened);
  return result;
}

ModelComparison Unfinished(Context context, std::vector<Hypothesis> hypotheses) {
  ModelComparison result;
  result.finished = false;
  result.ranked = Rank(context, SortedByEvidence(std::move(hypotheses)));
  return Finish(std::move(context), std::move(result));
}

}  // namespace

ModelComparison CompareModels(const SetModel& model, const FitResult& null,
                              const ComparisonSettings& settings,
                              const std::function<bool(double)>& progress) {
  // 1. Screen all effects and terms about the null model.
  Context context = MakeContext(model, null, settings, progress);
  const Screening about_null(model, null);
  ScreeningResult screened = ScreenExpected(context, about_null);
  context.screened = std::move(screened.effects);
  if (screened.stopped) return Unfinished(std::move(context), {});

  // 2. Fit the most promising ones, each by itself.
  StageResult found = FitSingles(context, {});
  if (found.stopped) return Unfinished(std::move(context), std::move(found.hypotheses));

  // 3. Follow a strong vibration through the recordings; else fit pairs and add random effects.
  found.hypotheses = FollowStrongVibration(context, std::move(found.hypotheses));
  BestRefit best;
  if (!VibrationIsFollowed(found.hypotheses)) {
    found = FitPairs(context, std::move(found.hypotheses));
    if (!found.stopped) best = RefitBest(context, found.hypotheses);
    if (found.stopped || best.stopped) {
      return Unfinished(std::move(context), std::move(found.hypotheses));
    }
    const FitResult* refit = best.fit ? &*best.fit : nullptr;
    found.hypotheses = AddRandomEffects(context, std::move(found.hypotheses), refit);
  }

  // 4. Fit all under one covariance, that of the best. A random effect has been compared under that
  // of the null model; another effect's covariance may contain it by chance.
  if (!RandomEffectLeads(found.hypotheses, best.fit ? &*best.fit : nullptr)) {
    std::erase_if(found.hypotheses, [](const Hypothesis& h) { return IsRandomEffect(h); });
    ReferenceResult reference = ReferenceOfBest(context, found.hypotheses, std::move(best.fit));
    if (reference.stopped) return Unfinished(std::move(context), std::move(found.hypotheses));
    context.null = std::move(reference.null);
    context.linearisation = std::move(reference.linearisation);
    found = FitUnderOneCovariance(context, std::move(found.hypotheses));
    if (found.stopped) return Unfinished(std::move(context), std::move(found.hypotheses));
    found.hypotheses = AddRandomEffects(context, std::move(found.hypotheses), nullptr);
  }

  // 5. Add random effects, then model-discrepancy terms, to the best; keep few coefficients.
  found = AddRandomEffectsBeside(context, std::move(found.hypotheses));
  if (!found.stopped) found = AddTermsBeside(context, std::move(found.hypotheses));
  if (found.stopped) return Unfinished(std::move(context), std::move(found.hypotheses));
  found.hypotheses = DropCoefficients(context, std::move(found.hypotheses));

  // 6. Rank, hold to predictions, and find what these recordings cannot tell apart.
  ModelComparison result = HoldToPredictions(context, Rank(context, std::move(found.hypotheses)));
  result.same_class = EquivalenceClass(context, about_null, result.ranked);
  return Finish(std::move(context), std::move(result));
}

}  // namespace sightline
