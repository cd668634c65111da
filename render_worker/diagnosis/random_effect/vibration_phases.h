// SPDX-License-Identifier: Apache-2.0
// A vibration of the image that is seen in single recordings, with the phase that each of them
// drew: how an exposure's displacements are distributed follows from it exactly, skew and all.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "render_worker/diagnosis/fit/fit.h"
#include "render_worker/diagnosis/fit/set_model.h"
#include "render_worker/diagnosis/random_effect/vibration_fit.h"

namespace sightline {

// Phases in the middle of the exposures [rad] that displacement and blur of the recordings speak
// for, of every recording of the set; 0 for those without laser light. `law`: amplitude [px] and
// frequency [Hz]. `movements`: of the recordings with laser light, in order.
std::vector<double> PhasesOfMovements(const SetModel& model, const std::vector<double>& law,
                                      std::span<const RecordedMovement> movements);

// The vibration (time.vibration_blur) with these phases instead of drawn ones.
std::unique_ptr<const Effect> VibrationAtPhases(const Effect& vibration,
                                                std::vector<double> phases_rad);

struct FollowedVibration {
  // The vibration is the last effect, its parameters the last free ones. Columns of the phases of
  // the recordings with laser light, in order, are in front of those of effects' parameters, in
  // units of their prior, which is normal with the variance of a uniform phase. Standard errors
  // have the phases integrated out.
  FitResult fit;
  std::vector<double> phases_rad;
};

// Fits the known parameters, `free` ones of the effects of `start`, amplitude and frequency of
// `vibration` (from `law`) and the phases (from `phases_rad`), by the model itself, in turn until
// neither gains.
FollowedVibration FollowVibration(const SetModel& model, const SetParameters& start,
                                  const std::vector<FreeEffectParameter>& free,
                                  const Effect& vibration, const std::vector<double>& law,
                                  std::vector<double> phases_rad);

}  // namespace sightline
