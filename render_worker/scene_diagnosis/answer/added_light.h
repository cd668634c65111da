// SPDX-License-Identifier: Apache-2.0
// The light of a hypothesis that the null model lacks.
#pragma once

#include "render_worker/scene_diagnosis/answer/excess_region.h"
#include "render_worker/scene_diagnosis/block/block_means.h"
#include "render_worker/scene_diagnosis/fit/compare_paths.h"
#include "render_worker/scene_diagnosis/light_paths.h"
#include "render_worker/scene_diagnosis/recorded_scene.h"

namespace sightline {

struct AddedLight {
  // Sums over all blocks of the mean photo-electrons of a pixel: of the added light, and of the
  // null model's laser light [electrons].
  double sum = 0, laser_sum = 0;
  ExcessRegion region;  // most significant region; none for the null model
};

// `null_fit`: fit of the null model alone, whose residuals show the light.
AddedLight FindAddedLight(const RecordedScene& scene, const SceneLight& light,
                          const BlockMeans& blocks, const PathHypothesis& hypothesis,
                          const PathFit& null_fit);

}  // namespace sightline
