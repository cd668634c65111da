// SPDX-License-Identifier: Apache-2.0
// Posterior predictive check: does a fitted model predict recordings that it was not fitted to? The
// check is made per statistic and per setting of the set-up.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "render_worker/diagnosis/fit/fit.h"

namespace sightline {

// Observation blocks that are checked together: one statistic in all recordings, or all statistics
// of the recordings with one value of a quantity of the set-up.
struct PredictedGroup {
  std::string name;  // "profile", "f_number 2.8", "dark frames"
  double chi_squared = 0;
  int degrees_of_freedom = 0;
  // Chi squared that the relative error kEffectError of the modelled change may add.
  double model_error = 0;
  double p_value = 1;
};

struct PredictiveCheck {
  std::vector<PredictedGroup> groups;
  // Smallest p-value of a group times the number of groups (Bonferroni's correction), at most 1.
  double p_value = 1;
  // Logarithm of the predictive density of the held-out data [nats], up to a constant of the data.
  double log_score = 0;
};

// Every recording is predicted from the other folds (HeldOutRecordings), as CrossValidate does. An
// effect that shows in one statistic of all recordings together cannot be predicted that way, so
// such a block is divided by pixels (DividedBlock).
// `null`: a fit of the same set without effects. The whitened change d from its expectation to that
// of `fit` has a relative error of kEffectError. Chi squared of a group of n components is
// therefore compared with a noncentral chi squared distribution of n degrees of freedom and
// noncentrality kEffectError^2 |d|^2, in Patnaik's approximation (Biometrika 36 (1949) 202). The
// covariances are model values too, so chi squared is first multiplied by kEvidenceWeight. The
// covariance of a corrected model contains the error of the change: its noncentrality is 0.
PredictiveCheck CheckPredictions(const SetModel& model, const FitResult& fit, const FitResult& null,
                                 uint64_t seed);

// Adds the result of another test of the same model as a group. The p-values of the two tests are
// combined by Bonferroni's correction.
void AddTest(const PredictedGroup& test, PredictiveCheck* check);

}  // namespace sightline
