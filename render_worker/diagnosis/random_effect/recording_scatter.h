// SPDX-License-Identifier: Apache-2.0
// Effects whose realisation is drawn anew for every recording (power noise, exposure jitter,
// vibration, free-form scatters of the power, the exposure and the place) or every place on the
// plate (texture, a free-form scatter of the reflectance): they say nothing about the expectation
// of a recording, only how recordings scatter about it.
#pragma once

#include <span>
#include <vector>

#include "render_worker/diagnosis/fit/fit.h"
#include "render_worker/diagnosis/fit/set_model.h"

namespace sightline {

// True for the effects that CompareRecordingScatter knows.
bool IsRecordingScatter(const Effect& effect);

// The amplitudes of the recordings are normal with the covariance K that the effect's law gives
// them; they are integrated out together with the known parameters.
struct ScatterCandidate {
  const Effect* effect = nullptr;
  std::vector<double> parameters;       // most probable; of its description
  std::vector<double> standard_errors;  // of them
  // Logarithm of the evidence over that of `null`, with a Cauchy prior of the standardised
  // parameters [nats], and its largest value over all parameters, without prior.
  double log_evidence = 0;
  double largest_gain = 0;
  // Most probable realisation, of every recording.
  std::vector<double> light_relative;  // amount of laser light minus 1
  std::vector<double> shift_px;        // of the image across the line
  // Of a vibration, in the middle of every exposure [rad], where single recordings tell; or empty.
  std::vector<double> phases_rad;
  // With the amplitudes as further parameters of standard normal prior behind those of `null`, so
  // that what a recording not fitted is predicted to be scatters by them. `chi_squared` is that
  // after the realisation has been taken off, by the model itself and not linearised.
  FitResult fit;
};

// One candidate for each of `effects` that is known, in that order. With V the whitened change of
// the entries per unit of every amplitude, P the projection that takes off what the known
// parameters absorb and r the whitened residual, b = V' P r and A = V' P V, the logarithm of the
// likelihood over that of the null is b' (1/K + A)^-1 b / 2 - log det(1 + K A) / 2 (Bishop, Pattern
// Recognition and Machine Learning, 3.5.1). `null`: a fit of `model` to all its data, perhaps
// with effects: what scatters besides them is looked for.
// `perhaps_strong`: where recordings of one place differ by far more than `null` allows, power
// noise, exposure jitter and vibration are found in turn with the known parameters, and a vibration
// that single recordings show is followed through them, which takes several fits. So is a texture
// that explains most of what `null` leaves, always.
std::vector<ScatterCandidate> CompareRecordingScatter(const SetModel& model, const FitResult& null,
                                                      std::span<const Effect* const> effects,
                                                      bool perhaps_strong = true);

// True if recordings of one place differ by far more than the fit allows.
bool ScattersStrongly(const SetModel& model, const FitResult& fit);

}  // namespace sightline
