// SPDX-License-Identifier: Apache-2.0
// A model-discrepancy term for light of unknown origin: a smooth map over the image.
#pragma once

#include <iterator>
#include <vector>

#include "render_worker/scene_diagnosis/light_paths.h"
#include "render_worker/scene_diagnosis/recorded_scene.h"

namespace sightline {

// Prior standard deviations of the coefficients that are tried [electrons]. Chosen a factor of four
// apart, from below the noise of a block's mean to far above the dark noise of a pixel.
inline constexpr double kMapScales_electrons[] = {1, 4, 16, 64};

// Light paths cos(pi v (i + 1/2) / rows) cos(pi u (j + 1/2) / columns) for v, u = 0 to 4, the same
// in each of the first `recordings` but zero in dark ones. Coefficients have normal priors of mean
// 0 and standard deviation `scale_electrons` and may be negative.
std::vector<LightPath> SmoothMap(const RecordedScene& scene, int recordings,
                                 double scale_electrons);

}  // namespace sightline
