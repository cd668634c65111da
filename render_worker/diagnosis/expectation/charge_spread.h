// SPDX-License-Identifier: Apache-2.0
// Speckle of charge that has moved between pixels: less contrast, longer correlation.
#pragma once

#include <array>
#include <memory>
#include <span>
#include <vector>

#include "core/image/image.h"
#include "render_worker/effects/effect.h"
#include "render_worker/speckle/speckle_statistics.h"

namespace sightline {

// Charge around the pixels of a strip of one column or of even width whose speckle is at a given
// level: f times the mean light. A neighbour's light is then not f times its mean: of bivariate
// gamma numbers of contrast squared c and correlation r the other's mean is 1 + r (f - 1), its
// variance c ((1 - r)^2 + 2 r (1 - r) f) (Kibble, Sankhya 5 (1941) 137).
class NeighboursOfLevel {
 public:
  // Mean electrons of the laser's light and of all else; `speckle` before anything flows, whose
  // contrast squared is `pattern_share` of that of one pattern. No pixel holds more than
  // `full_electrons`.
  NeighboursOfLevel(Image<double> laser, Image<double> steady, const LineSpeckle& speckle,
                    const FrameSetup& frame, double pattern_share, double full_electrons);

  // `electrons` of the level (`factor`: f of every pixel) after an effect that spreads by charge,
  // whose flow is a difference of squares: neighbours have their root mean square.
  Image<double> After(const ActiveEffect& effect, const FrameSetup& frame,
                      const Image<double>& electrons, const Image<double>& factor) const;

 private:
  double RootMeanSquare(int row, int column, double correlation, double f) const;

  Image<double> laser_, steady_;
  // Of every row: of the pixels, of neighbours.
  std::vector<double> contrast_squared_, across_line_, along_line_;
  double full_electrons_;
};

// Of the four pixels of a cell of the colour filter (by rows; all four alike without one), the one
// with most of `electrons`.
int BrightestCell(const Image<double>& electrons);

// Speckle of the four pixels of a cell after effects have spread `electrons`, the mean charge of a
// strip of one column or of even width; null where nothing spreads.
std::array<std::shared_ptr<const LineSpeckle>, 4> AfterChargeSpread(
    const LineSpeckle& speckle, const Image<double>& electrons, const FrameSetup& frame,
    std::span<const ActiveEffect> effects);

}  // namespace sightline
