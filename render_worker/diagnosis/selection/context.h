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
  // Takes the fraction done in [0, 1]. If it returns false, a stage returns at once and calls it no
  // more.
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

// `hypothesis` with its parameters fitted under the covariance of `reference`, from where it is
// (from those of `reference` if it has not been fitted), and its evidence.
struct FitEffort {
  bool renew_jacobian = false;  // derivatives with respect to the set-up's parameters; false: kept
  int max_iterations = 4;
};
Hypothesis FitHypothesis(const Context& context, Hypothesis hypothesis, const FitResult& reference,
                         const FitEffort& effort);

// The same from the nominal set-up under a covariance of its own: where the null model is far from
// the data, so are its parameters.
Hypothesis FitFromNominal(const Context& context, Hypothesis hypothesis);

// Largest evidence first. Hypotheses whose evidence is not finite are left out: their start left no
// light at all.
std::vector<Hypothesis> SortedByEvidence(std::vector<Hypothesis> hypotheses);

// Check of predictions of recordings left out. The predictions integrate over a random effect's
// amplitudes and cannot notice that these follow the set-up; that is tested in addition.
PredictiveCheck CheckHypothesis(const Context& context, const Hypothesis& hypothesis);

}  // namespace sightline
