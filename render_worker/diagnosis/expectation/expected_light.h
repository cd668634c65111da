// SPDX-License-Identifier: Apache-2.0
// Mean light on the pixels of a strip of a recording, before the sensor: a long line through the
// lens is a convolution in one dimension.
#pragma once

#include <complex>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "core/image/image.h"
#include "render_worker/effects/effect.h"
#include "render_worker/speckle/speckle_statistics.h"

namespace sightline {

// Its fringes may be finer than a block.
inline constexpr std::string_view kCoverGlassEtalon = "optics.cover_glass_etalon";

// Optics of a long line at one place of the field.
struct LineImaging {
  double curvature_per_m = 0;                  // of defocus, for which the rest holds
  int length = 0;                              // samples across the line
  std::vector<std::complex<double>> transfer;  // across the line, the pixel's included
  std::shared_ptr<const LineSpeckle> speckle;  // of one pattern
  // Of the laser on the plate, at the samples; empty: not the same all along the line.
  std::vector<double> irradiance_w_m2;
};

struct ExpectedLight {
  // Mean electrons by light over speckle: in all, and of what is not the laser's.
  Image<double> total_electrons, steady_electrons;
  std::shared_ptr<const LineImaging> imaging;  // of the laser's light; as given if there is none
  // Laser light at evenly spaced places of the block that the strip stands for, over its mean;
  // empty: alike all along.
  std::vector<double> level_along_line;
  double pattern_share = 0;  // contrast squared of all speckle patterns over that of one
};

// `frame`: as effects of the setup leave it. `effects`: without those whose is_drawn holds.
// `imaging`: of another strip of the frame, or null; taken over as far as the optics are the same
// all over the field, and its speckle always. `block_columns_px`: of the block that the strip is
// the middle of and whose mean it stands for; 0: for itself.
ExpectedLight ExpectLight(const FrameSetup& frame, std::span<const ActiveEffect> effects,
                          std::shared_ptr<const LineImaging> imaging, int block_columns_px);

}  // namespace sightline
