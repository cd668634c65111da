// SPDX-License-Identifier: Apache-2.0
// Posterior predictive checks: whether a fitted model predicts recordings that it was not fitted
// to, kind of observable by kind and setting by setting.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "render_worker/diagnosis/fit/fit.h"

namespace sightline {

// Numbers of the set that are checked together: one kind of statistic in all recordings, or all
// statistics of the recordings with one value of a quantity of the set-up.
struct PredictedGroup {
  std::string name;  // "profile", "f_number 2.8", "dark frames"
  double chi_squared = 0;
  int degrees_of_freedom = 0;
  // Chi squared that the known error of the modelled change (kEffectError) may add.
  double model_error = 0;
  double p_value = 1;
};

struct PredictiveCheck {
  std::vector<PredictedGroup> groups;
  // The smallest p-value of a group, times the number of groups (Bonferroni), at most 1.
  double p_value = 1;
  // Logarithm of the density of the held-out data [nats], but for a constant of the data.
  double log_score = 0;
};

// Every recording is predicted by a fit to the other folds (HeldOutRecordings), as CrossValidate
// does. `null`: a fit of the same set without effects; what `fit` changes of its expectation is
// taken to be modelled to kEffectError, so the chi squared of a group of n numbers of which it
// changes d (whitened) is held against a noncentral chi squared of n degrees of freedom and
// noncentrality kEffectError^2 |d|^2, by Patnaik's approximation (Biometrika 36 (1949) 202).
// The statistics' covariances are models, too: chi squared counts by kEvidenceWeight.
PredictiveCheck CheckPredictions(const SetModel& model, const FitResult& fit, const FitResult& null,
                                 uint64_t seed);

// With the result of another test of the same model, which is reported as a group; p-values of the
// two tests are combined by Bonferroni's rule.
void AddTest(const PredictedGroup& test, PredictiveCheck* check);

// Largest Bayes factor against a model that a p-value can stand for: 1 / (-e p ln p) for p < 1/e,
// else 1 (Sellke, Bayarri and Berger, Am. Stat. 55 (2001) 62).
double BayesFactorBound(double p_value);

}  // namespace sightline
