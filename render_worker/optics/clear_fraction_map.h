// SPDX-License-Identifier: Apache-2.0
// Vignetting over the field.
#pragma once

#include <vector>

#include "core/image/image.h"
#include "render_worker/frame/ideal_image.h"
#include "render_worker/optics/image_optics.h"

namespace sightline {

// Fraction of the light that the pupil passes towards a position on the sensor, relative to the
// clear circle of the ideal irradiance. Bilinear between nodes, since pupils change slowly.
class ClearFractionMap {
 public:
  ClearFractionMap(const OpticsModel& optics, const SubPixelGrid& grid, int threads);
  // At sample (row, column) of the grid.
  float At(int row, int column) const;

 private:
  int step_ = 0;     // samples between nodes; 0: constant
  float value_ = 1;  // value if constant
  Image<float> nodes_;
};

}  // namespace sightline
