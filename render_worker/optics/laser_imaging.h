// SPDX-License-Identifier: Apache-2.0
// Laser light through the lens, block by block.
#pragma once

#include <vector>

#include "render_worker/optics/image_optics.h"

namespace sightline {

// Laser part of ApplyOptics: mean irradiance of the pixels of the region of interest.
Image<float> ImageLaser(const IdealImage& image, const OpticsModel& optics,
                        const SpeckleModel& speckle, int threads);

// A transform made by ImageLaser: its first pixel, relative to the grid's first, and its period.
struct LaserTransform {
  int column_px = 0;
  int row_px = 0;
  int columns_px = 0;
  int rows_px = 0;
};
// The transforms of an image, in order: their cost, and the frequencies of the pupil's samples.
std::vector<LaserTransform> PlanLaserTransforms(const IdealImage& image, const OpticsModel& optics,
                                                int threads);

}  // namespace sightline
