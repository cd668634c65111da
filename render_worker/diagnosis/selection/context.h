// SPDX-License-Identifier: Apache-2.0
// Inputs that all stages of the model comparison share, and fits of a hypothesis given these.
#pragma once

#include <functional>
#include <vector>

#include "render_worker/diagnosis/fit/predictive_check.h"
#include "render_worker/diagnosis/selection/compare_models.h"
#include "render_worker/diagnosis/selection/hypothesis.h"
#include "render_worker/diagnosis/selection/screening/screening.h"

namespace sightline {

// Stages only read it. CompareModels sets `screened` after the first stage, `null` and
// `linearisation` when the covariance changes.
struct Context {
  const SetModel& model;
  const ComparisonSettings& settings;
  // Gets the fraction done in [0, 1]. After it returns false, a stage returns at once without
  // calling it again.
  const std::function<bool(double)>& proceed;
  // Effects and terms of the settings that change the expectation, and those that are random
  // effects per recording or place.
  std::vector<const Effect*> expected, random;
  std::vector<ScreenedEffect> screened;  // about the null model
  FitResult null;                        // under the covariance of all hypotheses
  // Its derivatives with respect to the set-up's parameters count in all evidences.
  FitResult linearisation;
};

// `screened` is empty; `null` is both reference and linearisation. `model`, `settings` and
// `progress` must outlive it.
Context MakeContext(const SetModel& model, const FitResult& null,
                    const ComparisonSettings& settings,
                    const std::function<bool(double)>& progress);

bool NullIsRejected(const Context& context);

// Fits the parameters of `hypothesis` under the covariance of `reference` and sets its evidence.
// The fit starts at the parameters of `hypothesis` (at those of `reference` if it was never
// fitted).
struct FitEffort {
  bool renew_jacobian = false;  // derivatives with respect to the set-up's parameters; false: kept
  int max_iterations = 4;
};
Hypothesis FitHypothesis(const Context& context, Hypothesis hypothesis, const FitResult& reference,
                         const FitEffort& effort);

// The same from the nominal set-up under its own covariance: if the null model is far from the
// data, so are its parameters.
Hypothesis FitFromNominal(const Context& context, Hypothesis hypothesis);

// Largest evidence first. Hypotheses whose evidence is not finite are left out: their start left no
// light at all.
std::vector<Hypothesis> SortedByEvidence(std::vector<Hypothesis> hypotheses);

// Checks predictions of held-out recordings. The predictions integrate over a random effect's
// amplitudes and cannot notice that these follow the set-up, so that is tested in addition.
PredictiveCheck CheckHypothesis(const Context& context, const Hypothesis& hypothesis);

}  // namespace sightline
