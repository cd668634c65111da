// SPDX-License-Identifier: Apache-2.0
// Mean light on the pixels of a column sample of a recording, before the sensor. Through the lens,
// the image of a long line is a convolution in one dimension.
#pragma once

#include <complex>
#include <memory>
#include <span>
#include <vector>

#include "core/image/image.h"
#include "render_worker/effects/effect.h"
#include "render_worker/speckle/speckle_statistics.h"

namespace sightline {

// Optics of a long line at one position of the field.
struct LineImaging {
  double curvature_per_m = 0;                  // of the defocus that the other members belong to
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
  // Laser light, relative to its mean, at evenly spaced positions of the segment that the column
  // sample represents; empty: constant.
  std::vector<double> level_along_line;
  double pattern_share = 0;  // contrast squared of all speckle patterns over that of one
};

// `frame`: after the effects on its numbers. `effects`: those that change the expectation.
// `imaging`: from another column sample of the frame, or null. Its speckle is reused, and its other
// members too if the optics are constant over the field. `block_columns_px`: width of the segment
// in whose middle the column sample lies and whose mean it represents; 0: no segment.
ExpectedLight ExpectLight(const FrameSetup& frame, std::span<const ActiveEffect> effects,
                          std::shared_ptr<const LineImaging> imaging, int block_columns_px);

}  // namespace sightline
