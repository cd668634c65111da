// SPDX-License-Identifier: Apache-2.0
// The description of the set with fitted values, and the effects to add to it.
#pragma once

#include "render_worker/scene_diagnosis/fit/path_fit.h"
#include "render_worker/scene_diagnosis/recorded_scene.h"
#include "sightline/v1/diagnosis.pb.h"

namespace sightline {

// Sets `calibrated`: laser power, dark charge and lamps multiplied or shifted by the factors of
// `fit`. Adds to `calibrated_effects` the light paths that the null model lacks; parameters of
// effects of the vocabulary are clamped to the bounds of the renderer. Adds to `inspection_changes`
// how an inspection expresses them.
void AddCalibration(const RecordedScene& scene, const PathFit& fit, v1::Diagnosis* diagnosis);

}  // namespace sightline
