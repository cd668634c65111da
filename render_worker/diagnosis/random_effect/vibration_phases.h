// SPDX-License-Identifier: Apache-2.0
// A vibration of the image that is seen in single recordings, with the phase of each of them as a
// parameter. The phase determines the distribution of displacements during an exposure exactly, its
// skew included.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "render_worker/diagnosis/fit/fit.h"
#include "render_worker/diagnosis/fit/set_model.h"
#include "render_worker/diagnosis/random_effect/vibration_fit.h"

namespace sightline {

// Most probable phases in the middle of the exposures [rad], given displacement and blur of the
// recordings: one per recording of the set, 0 for those without laser light. `law`: amplitude [px]
// and frequency [Hz]. `movements`: of the recordings with laser light, in order.
std::vector<double> PhasesOfMovements(const SetModel& model, const std::vector<double>& law,
                                      std::span<const RecordedMovement> movements);

// The effect `vibration` with these phases, one per recording, instead of random ones.
std::unique_ptr<const Effect> VibrationAtPhases(const Effect& vibration,
                                                std::vector<double> phases_rad);

struct FollowedVibration {
  // The vibration is the last effect, its parameters the last free ones. The phases of the
  // recordings with laser light, in order, stand before the effects' parameters, standardised by a
  // normal prior with the variance of a uniform phase. Standard errors are marginal: phases are
  // integrated out.
  FitResult fit;
  std::vector<double> phases_rad;
};

// Fits the nuisance parameters, the parameters `free` of the effects of `start`, amplitude and
// frequency of `vibration` (from `law`) and the phases (from `phases_rad`) by the full model: the
// phases and all others in turn, until the cost no longer decreases.
FollowedVibration FollowVibration(const SetModel& model, const SetParameters& start,
                                  const std::vector<FreeEffectParameter>& free,
                                  const Effect& vibration, const std::vector<double>& law,
                                  std::vector<double> phases_rad);

}  // namespace sightline
