// SPDX-License-Identifier: Apache-2.0
// Mean light on the pixels of a column sample of a recording, before the sensor. The image of a
// long line through the lens is a convolution in one dimension.
#pragma once

#include <complex>
#include <memory>
#include <span>
#include <vector>

#include "core/image/image.h"
#include "render_worker/effects/effect.h"
#include "render_worker/speckle/speckle_statistics.h"

namespace sightline {

// Optics of a long line at one place of the field.
struct LineImaging {
  double curvature_per_m = 0;                  // of the defocus for which the rest holds
  int length = 0;                              // samples across the line
  std::vector<std::complex<double>> transfer;  // across the line, the pixel's included
  std::shared_ptr<const LineSpeckle> speckle;  // of one pattern
  // Laser irradiance of the plate at the samples; empty if it varies along the line.
  std::vector<double> irradiance_w_m2;
};

struct ExpectedLight {
  // Mean electrons by all light, and by light other than the laser's.
  Image<double> total_electrons, steady_electrons;
  std::shared_ptr<const LineImaging> imaging;  // of the laser's light; as given if there is none
  // Laser light at evenly spaced places of the block that the column sample stands for, over its
  // mean; empty: the same everywhere.
  std::vector<double> level_along_line;
  double pattern_share = 0;  // contrast squared of all speckle patterns over that of one
};

// `frame`: after the effects on its numbers. `effects`: those that change the expectation.
// `imaging`: of another column sample of the frame, or null; its speckle is taken over, and the
// rest if the optics are the same all over the field. `block_columns_px`: width of the block whose
// middle the column sample is and whose mean it stands for; 0: it stands for itself.
ExpectedLight ExpectLight(const FrameSetup& frame, std::span<const ActiveEffect> effects,
                          std::shared_ptr<const LineImaging> imaging, int block_columns_px);

}  // namespace sightline
