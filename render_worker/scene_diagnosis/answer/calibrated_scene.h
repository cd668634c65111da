// SPDX-License-Identifier: Apache-2.0
// The set's description with fitted values, and effects to be added to it.
#pragma once

#include "render_worker/scene_diagnosis/fit/path_fit.h"
#include "render_worker/scene_diagnosis/recorded_scene.h"
#include "sightline/v1/diagnosis.pb.h"

namespace sightline {

// Sets `calibrated`: laser power, dark charge and lamps scaled or shifted by the factors of `fit`.
// Adds to `calibrated_effects` the light paths that the null model lacks; parameters of effects of
// the vocabulary are clamped to the bounds of the renderer. Adds to `inspection_changes` the
// corresponding fields of an inspection.
void AddCalibration(const RecordedScene& scene, const PathFit& fit, v1::Diagnosis* diagnosis);

}  // namespace sightline
