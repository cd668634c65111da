// SPDX-License-Identifier: Apache-2.0
// Bayesian model comparison: which effects, one or several together, explain a set best.
//
//   ComparisonSettings settings;
//   settings.effects = AllEffects();
//   const ModelComparison result = CompareModels(model, FitSet(model, start, {}, {}, nullptr),
//                                                settings, [](double) { return true; });
//   result.ranked.front();  // the most probable hypothesis
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "render_worker/diagnosis/fit/predictive_check.h"
#include "render_worker/diagnosis/selection/hypothesis.h"
#include "render_worker/diagnosis/selection/screening/screening.h"
#include "render_worker/evidence/judgement.h"

namespace sightline {

struct ComparisonSettings {
  std::span<const Effect* const> effects;     // of the vocabulary
  std::span<const Effect* const> free_forms;  // model-discrepancy terms
  int max_effects = 2;                        // largest number of effects in a hypothesis, >= 1
  uint64_t seed = 1;                          // of the choice of recordings that are left out
};

// The part of the difference between the recordings and the null model that the answer leaves.
struct RemainderOfAnswer {
  const Effect* term = nullptr;  // model-discrepancy term that describes it best; null: none does
  double share = 0;              // of the null model's excess on held-out recordings, in [0, 1]
  double probability = 0;        // that it is physics which the vocabulary lacks, in [0, 1]
  bool small_share_decides = false;  // Remainder::small_share_decides
};

// Prediction of settings that were held out, by functions of one stage.
struct StageTransfer {
  Stage stage = Stage::kIllumination;
  double gain = 0;    // of the log predictive density over the null model [nats]
  double behind = 0;  // the best stage [nats]
  double behind_standard_error = 0;
};

struct ModelComparison {
  // False: `progress` stopped it. `null`, `screened` and `ranked` hold what was found until then,
  // ranked by evidence; no predictive check was made.
  bool finished = true;
  // True: the expectation of all fits is corrected by renderings at the parameters of the model
  // that was the best named one before (correction/rendered_correction.h).
  bool rendered = false;
  // Effects that are taken for granted: all hypotheses contain them (SetModel::EffectsOf).
  std::vector<ActiveEffect> evident;
  FitResult null;                  // the null model, under the covariance of all hypotheses
  std::vector<Hypothesis> ranked;  // most probable first; the null model is one of them
  std::vector<ScreenedEffect> screened;
  // Effects that change the expectation as ranked.front()'s first effect does, so that these
  // recordings cannot tell them apart.
  std::vector<const Effect*> same_class;
  // The most probable hypothesis without a model-discrepancy term, which may be the null model, and
  // the predictive checks of the null model and of it.
  Hypothesis named;
  PredictiveCheck null_check, named_check;
  // Share of the difference that `named` may leave and still be the answer (evidence/judgement.h).
  double share_names_may_leave = kShareNamesMayLeave;
  // Stages with the largest gain first. Empty: no hypothesis with a model-discrepancy term leads.
  std::vector<StageTransfer> transfer;
  // Unset: nothing speaks for it, or ranked.front() has a model-discrepancy term.
  std::optional<RemainderOfAnswer> remainder;
};

// `null`: a fit of `model` without effects. `progress` gets the fraction done in [0, 1] from the
// calling thread; if it returns false, the comparison stops (ModelComparison::finished).
ModelComparison CompareModels(const SetModel& model, const FitResult& null,
                              const ComparisonSettings& settings,
                              const std::function<bool(double)>& progress);

}  // namespace sightline
