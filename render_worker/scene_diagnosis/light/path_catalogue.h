// SPDX-License-Identifier: Apache-2.0
// Light paths that are compared for a scene, with the priors of their factors. TraceLightPaths
// fills in the images.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "render_worker/scene_diagnosis/light_paths.h"
#include "render_worker/scene_diagnosis/recorded_scene.h"

namespace sightline {

// Fraction of light in the halo at which the image of veiling glare is computed [1]. The image is
// linear in the fraction, so this value only affects rounding.
inline constexpr double kRenderedGlareFraction = 0.1;

// Light paths without images, and the index of each in `paths`.
struct PathCatalogue {
  std::vector<LightPath> paths;  // those of the null model first
  // Null model.
  size_t laser = 0, dark_charge = 0;
  std::optional<size_t> lamps;  // unset: the description has no other light
  // Paths that the null model may lack; unset if it contains them or if there is no such light.
  std::optional<size_t> laser_interreflection, lamp_interreflection;
  size_t surround = 0;
  std::vector<size_t> stray_light, veiling_glare;  // one for each shape, ascending
  size_t sensor_offset = 0;
};

// True if the null model's laser light includes reflections between surfaces.
bool NullModelHasInterreflection(const RenderSettings& render);

// Priors of the null model's factors come from the uncertainties stated with the recordings, or
// else from an assumption named in the source.
PathCatalogue MakePathCatalogue(const RecordedScene& scene);

}  // namespace sightline
