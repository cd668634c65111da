// SPDX-License-Identifier: Apache-2.0
// Evidence of random effects: of power, exposure time or place, which differ between recordings, or
// of the plate's reflectance, which differs between places. They do not change the expectation of a
// recording, only the variance and covariance between recordings.
#pragma once

#include <span>
#include <vector>

#include "render_worker/diagnosis/fit/fit.h"
#include "render_worker/diagnosis/fit/set_model.h"
#include "render_worker/diagnosis/random_effect/law/random_effect.h"

namespace sightline {

// One random effect as an explanation of the recordings. Its amplitudes are N(0, K); they are
// integrated out together with the nuisance parameters.
struct RandomEffectCandidate {
  const Effect* effect = nullptr;
  std::vector<double> parameters;       // most probable, in the order of its description
  std::vector<double> standard_errors;  // of them
  // Logarithm of the evidence over that of the null model [nats], with a Cauchy prior of the
  // standardised parameters.
  double log_evidence = 0;
  // Largest log likelihood ratio over all parameters [nats], without prior.
  double largest_gain = 0;
  // Most probable realisation: one value per recording of the set.
  std::vector<double> light_relative;  // amount of laser light minus 1
  std::vector<double> shift_px;        // displacement of the image across the line
  // Phases of a vibration in the middle of every exposure [rad]. Empty unless single recordings
  // show it.
  std::vector<double> phases_rad;
  // The standardised amplitudes are further parameters with a standard normal prior behind those of
  // the null model, so that predictions of other recordings contain their variance. `chi_squared`
  // is that of the full model at the realisation.
  FitResult fit;
};

// One candidate for each of `effects` with a random law, in their order. The likelihood is that of
// linear_mixed_model.h. `null`: a fit of `model` to all its data, perhaps with effects; random
// effects are added to these.
//
// `perhaps_strong`: if RecordingsDifferStrongly(null), random effects of power, exposure time and
// movement are fitted in turn with the nuisance parameters, and phases of a vibration are fitted
// that single recordings show. This takes several fits. A texture that explains most of what `null`
// leaves is fitted in turn whether `perhaps_strong` or not.
std::vector<RandomEffectCandidate> CompareRandomEffects(const SetModel& model,
                                                        const FitResult& null,
                                                        std::span<const Effect* const> effects,
                                                        bool perhaps_strong = true);

// True if recordings of one plate position differ by far more than the fit allows: then its
// parameters may be wrong.
bool RecordingsDifferStrongly(const SetModel& model, const FitResult& fit);

}  // namespace sightline
