// SPDX-License-Identifier: Apache-2.0
// Region in the images, and on the part, with significant light that the null model lacks.
#pragma once

#include <Eigen/Core>
#include <string>

#include "render_worker/scene_diagnosis/block/block_grid.h"
#include "render_worker/scene_diagnosis/light_paths.h"
#include "render_worker/scene_diagnosis/recorded_scene.h"

namespace sightline {

struct ExcessRegion {
  int recording = -1;  // -1: no significant region
  // Bounding box of the region's blocks.
  int first_row_px = 0, last_row_px = 0, first_column_px = 0, last_column_px = 0;
  double mean_electrons = 0;  // mean of the light over the region's blocks
  // The surface with most of the light, and its share; empty: no surface is visible.
  std::string surface;
  double surface_share = 0;
  Eigen::Vector3d place_m = Eigen::Vector3d::Zero();  // of the brightest block, part coordinates
};

// The connected region of one recording with the largest sum of `electrons` among blocks in which
// the standardised residual of the refitted null model is at least 3. Both vectors have one element
// per block. Blocks are connected along their sides.
ExcessRegion FindExcessRegion(const RecordedScene& scene, const SceneLight& light,
                              const BlockGrid& grid, const Eigen::VectorXd& null_residuals,
                              const Eigen::VectorXd& electrons);

}  // namespace sightline
