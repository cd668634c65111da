// SPDX-License-Identifier: Apache-2.0
// Correction of the fast model by renderings of the recordings at one point of its parameters.
//
// The fast model errs by one or two percent of the change that an effect makes. Where an effect is
// strong, that error is many standard deviations and no sign of missing physics. With images of the
// exact chain at the parameters z*, the expectation mu(z) + c, c = mean of their statistics -
// mu(z*), has no such error near z* (two fidelities: Kennedy and O'Hagan, Biometrika 87 (2000) 1;
// Peherstorfer, Willcox and Gunzburger, SIAM Review 60 (2018) 550).
//
//   auto rendered = RenderStatistics(model, named.parameters, {}, proceed);
//   const SetModel corrected(model, CorrectionOf(model, named, null, *rendered));
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "absl/status/statusor.h"
#include "render_worker/diagnosis/fit/fit.h"

namespace sightline {

struct RenderingSettings {
  // Number of renderings of the whole set with different seeds; at least 2. Chosen: the error of
  // their mean adds a quarter to the covariance, and each takes some seconds.
  int renderings = 4;
  uint64_t seed = 1;
};

// Statistics of every rendering, in the layout of the model's recordings. The model's own errors
// (SetParameters::model_error) and random effects are not rendered. `proceed` is asked before every
// image; CANCELLED if it returns false. Other errors are those of RenderPlateFrame.
absl::StatusOr<std::vector<BlockVectors>> RenderStatistics(const SetModel& model,
                                                           const SetParameters& parameters,
                                                           const RenderingSettings& settings,
                                                           const std::function<bool()>& proceed);

// The correction at the parameters of `fit` by `rendered`, n >= 2 renderings there. `null`: a fit
// of the same model without effects. Covariance of block e:
//   (s/n) Sigma_e + eps^2 d_e d_e'
// with the model's covariance Sigma_e, the ratio s of the variance among renderings to the model's,
// pooled over all blocks of a statistic, the change d_e from `null` to `fit`, and its relative
// error eps = kEffectError.
ExpectationCorrection CorrectionOf(const SetModel& model, const FitResult& fit,
                                   const FitResult& null,
                                   const std::vector<BlockVectors>& rendered);

}  // namespace sightline
