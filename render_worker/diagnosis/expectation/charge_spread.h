// SPDX-License-Identifier: Apache-2.0
// Speckle of charge that has moved between pixels: lower contrast, longer correlation.
#pragma once

#include <array>
#include <memory>
#include <span>
#include <vector>

#include "core/image/image.h"
#include "render_worker/effects/effect.h"
#include "render_worker/speckle/speckle_statistics.h"

namespace sightline {

// Charge around the pixels of a column sample (one column, or an even number of them) at a given
// level of speckle: f times the mean light. The light of a neighbour is then not f times its mean.
// For a bivariate gamma distribution of contrast squared c and correlation r, its conditional mean
// is 1 + r (f - 1) and its conditional variance c ((1 - r)^2 + 2 r (1 - r) f) (Kibble, Sankhya 5
// (1941) 137).
class NeighboursOfLevel {
 public:
  // `laser`, `steady`: mean electrons of laser light and of other light. `speckle`: one pattern
  // before any charge flows; the contrast squared of all patterns is `pattern_share` times that.
  // Pixels are limited to `full_electrons`.
  NeighboursOfLevel(Image<double> laser, Image<double> steady, const LineSpeckle& speckle,
                    const FrameSetup& frame, double pattern_share, double full_electrons);

  // `electrons` of the level (`factor`: f of every pixel) after an effect that spreads by charge,
  // whose flow is a difference of squares: neighbours have their root mean square.
  Image<double> After(const ActiveEffect& effect, const FrameSetup& frame,
                      const Image<double>& electrons, const Image<double>& factor) const;

 private:
  double RootMeanSquare(int row, int column, double correlation, double f) const;

  Image<double> laser_, steady_;
  // Contrast squared of every row, and the correlation with neighbours across and along the line.
  std::vector<double> contrast_squared_, across_line_, along_line_;
  double full_electrons_;
};

// The pixel with most of `electrons` among the four of a cell of the colour filter, 0 to 3 by rows.
int BrightestCell(const Image<double>& electrons);

// Speckle of the four pixels of a cell after effects have spread `electrons`, the mean charge of a
// column sample (one column, or an even number); null if no effect spreads charge.
std::array<std::shared_ptr<const LineSpeckle>, 4> AfterChargeSpread(
    const LineSpeckle& speckle, const Image<double>& electrons, const FrameSetup& frame,
    std::span<const ActiveEffect> effects);

}  // namespace sightline
