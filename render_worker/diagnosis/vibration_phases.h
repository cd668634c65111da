// A vibration of the image that is seen in single recordings, with the phase that each of them
// drew: how an exposure's displacements are distributed follows from it exactly, skew and all.
#pragma once

#include <span>
#include <vector>

#include "render_worker/diagnosis/fit.h"
#include "render_worker/diagnosis/set_model.h"
#include "render_worker/diagnosis/vibration_fit.h"

namespace sightline {

// Fits the known parameters, `free` ones of the effects of `start`, amplitude and frequency of
// `vibration` (time.vibration_blur) and the phases, by the model itself, in turn until neither
// gains. `law`: amplitude [px] and frequency [Hz] to begin with, from which `movements` of the
// recordings with laser light, in order, give the first phases.
//
// The vibration is the last effect of the result, its parameters the last free ones; behind their
// columns are those of the phases of the recordings with laser light, in order and in units of
// their prior, which is normal with the variance of a uniform phase. Standard errors have the
// phases integrated out.
FitResult FitVibrationPhases(const SetModel& model, const SetParameters& start,
                             const std::vector<FreeEffectParameter>& free, const Effect& vibration,
                             const std::vector<double>& law,
                             std::span<const RecordedMovement> movements);

}  // namespace sightline
