// SPDX-License-Identifier: Apache-2.0
// Converts fits of light paths to messages: chi squared by recording, deviations from the
// description, and maps of standardised residuals.
#pragma once

#include "render_worker/scene_diagnosis/block/block_grid.h"
#include "render_worker/scene_diagnosis/fit/path_fit.h"
#include "sightline/v1/diagnosis.pb.h"

namespace sightline {

v1::ModelFit PathFitMessage(const BlockGrid& grid, const PathFit& fit);

// Chi squared per degree of freedom of held-out tiles before and after.
v1::HeldOutImprovement HeldOutImprovementOf(const BlockGrid& grid, const PathFit& null_fit,
                                            const PathFit& model_fit);

// Adds one map for each recording, with a residual for each block.
void AddResidualMaps(const BlockGrid& grid, const PathFit& null_fit, const PathFit& model_fit,
                     v1::Diagnosis* diagnosis);

}  // namespace sightline
