// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/selection/compare_models.h"

#include <algorithm>
#include <optional>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/status/status_macros.h"
#include "render_worker/diagnosis/correction/rendered_correction.h"
#include "render_worker/diagnosis/random_effect/compare_random_effects.h"
#include "render_worker/diagnosis/selection/context.h"
#include "render_worker/diagnosis/selection/stages/screen.h"
#include "render_worker/diagnosis/selection/stages/stages.h"
#include "render_worker/diagnosis/selection/thresholds.h"
#include "render_worker/evidence/judgement.h"

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

// Adds to the best what it may lack: a random effect, a second effect, a model-discrepancy term.
// Keeps few coefficients of the terms.
StageResult AddBesideBest(const Context& context, std::vector<Hypothesis> hypotheses) {
  StageResult found = AddRandomEffectsBeside(context, std::move(hypotheses));
  if (!found.stopped) found = AddSecondEffect(context, std::move(found.hypotheses));
  if (!found.stopped) found = AddTermsBeside(context, std::move(found.hypotheses));
  if (!found.stopped) found = AddStageDiscrepancies(context, std::move(found.hypotheses));
  if (found.stopped) return found;
  return {DropCoefficients(context, std::move(found.hypotheses))};
}

// True if errors of the fast model may decide about a named model, and it can be rendered: random
// effects have values of their own in every rendering. It is about to be rejected, or a discrepancy
// describes what it leaves, so that this is either an error of the fast model or unknown physics.
bool NeedsRenderings(const Context& context, const ModelComparison& comparison) {
  const Hypothesis& named = comparison.named;
  const bool in_doubt = comparison.named_check.p_value < kRejectedBelow ||
                        IsFreeForm(comparison.ranked.front()) ||
                        (comparison.remainder && comparison.remainder->small_share_decides);
  const auto is_random = [](const ActiveEffect& active) { return HasRandomLaw(*active.effect); };
  return in_doubt && !named.effects.empty() &&
         std::none_of(named.effects.begin(), named.effects.end(), is_random) &&
         ModelErrorsCount(context, named);
}

// The model with the correction at the parameters of `named`. Errors of RenderStatistics.
absl::StatusOr<SetModel> Corrected(const Context& context, const Hypothesis& named) {
  const RenderingSettings settings = {.seed = context.settings.seed};
  SIGHTLINE_ASSIGN_OR_RETURN(const std::vector<BlockVectors> rendered,
                             RenderStatistics(context.model, named.fit.parameters, settings, [&] {
                               return context.proceed(thresholds::kRenderingDone);
                             }));
  return SetModel(context.model, CorrectionOf(context.model, named.fit, context.null, rendered));
}

// The hypotheses to be compared again about `named`, which comes first. What is added to the best
// is looked for again.
std::vector<Hypothesis> WithoutAdditions(const Hypothesis& named,
                                         const std::vector<Hypothesis>& hypotheses) {
  std::vector<Hypothesis> kept = {named};
  for (const Hypothesis& hypothesis : hypotheses) {
    const bool is_named =
        hypothesis.effects.size() == named.effects.size() &&
        std::all_of(named.effects.begin(), named.effects.end(),
                    [&](const auto& active) { return Has(hypothesis, active.effect); });
    const bool has_random =
        std::any_of(hypothesis.effects.begin(), hypothesis.effects.end(),
                    [](const ActiveEffect& active) { return HasRandomLaw(*active.effect); });
    const bool term_beside = IsFreeForm(hypothesis) && hypothesis.effects.size() > 1;
    if (!is_named && !has_random && !term_beside) kept.push_back(hypothesis);
  }
  return kept;
}

// The comparison under the expectation corrected at the named model; unset: stopped.
std::optional<ModelComparison> CompareCorrected(Context context, const SetModel& corrected,
                                                std::vector<Hypothesis> hypotheses) {
  Context again = MakeContext(corrected, context.null, context.settings, context.proceed);
  again.screened = std::move(context.screened);
  ReferenceResult reference = ReferenceOfBest(again, hypotheses, std::nullopt);
  if (reference.stopped) return std::nullopt;
  again.null = std::move(reference.null);
  again.linearisation = std::move(reference.linearisation);
  StageResult found = FitUnderOneCovariance(again, std::move(hypotheses));
  if (found.stopped) return std::nullopt;
  found.hypotheses = AddRandomEffects(again, std::move(found.hypotheses), nullptr);
  found = AddBesideBest(again, std::move(found.hypotheses));
  if (found.stopped) return std::nullopt;
  ModelComparison result = HoldToPredictions(again, Rank(again, std::move(found.hypotheses)));
  if (IsFreeForm(result.ranked.front())) result.transfer = TransferOfStages(again, result.ranked);
  return Finish(std::move(again), std::move(result));
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

  // 5. Add random effects, a second effect and model-discrepancy terms to the best.
  found = AddBesideBest(context, std::move(found.hypotheses));
  if (found.stopped) return Unfinished(std::move(context), std::move(found.hypotheses));

  // 6. Rank and hold to predictions.
  ModelComparison result = HoldToPredictions(context, Rank(context, found.hypotheses));

  // 7. Where the fast model's errors may decide about a named model, compare again with the
  // expectation corrected by renderings.
  if (NeedsRenderings(context, result)) {
    const absl::StatusOr<SetModel> corrected = Corrected(context, result.named);
    if (absl::IsCancelled(corrected.status())) {
      return Unfinished(std::move(context), std::move(found.hypotheses));
    }
    if (corrected.ok()) {
      std::optional<ModelComparison> again =
          CompareCorrected(context, *corrected, WithoutAdditions(result.named, found.hypotheses));
      if (!again) return Unfinished(std::move(context), std::move(found.hypotheses));
      again->rendered = true;
      again->same_class = EquivalenceClass(context, about_null, again->ranked);
      return *std::move(again);
    }
  }

  // 8. Locate unknown physics, and find effects that these recordings cannot distinguish.
  if (IsFreeForm(result.ranked.front())) result.transfer = TransferOfStages(context, result.ranked);
  result.same_class = EquivalenceClass(context, about_null, result.ranked);
  return Finish(std::move(context), std::move(result));
}

}  // namespace sightline
