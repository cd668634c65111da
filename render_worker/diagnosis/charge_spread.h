// Speckle of charge that has moved between pixels: less contrast, longer correlation.
#pragma once

#include <array>
#include <memory>
#include <span>
#include <vector>

#include "core/image/image.h"
#include "render_worker/diagnosis/speckle_statistics.h"
#include "render_worker/effects/effect.h"

namespace sightline {

// True for effects that move charge between neighbouring pixels.
bool SpreadsCharge(const Effect& effect);
// True for those of them that move the more the more charge there is: to these neighbours are not
// as bright as the pixel itself.
bool SpreadsByCharge(const Effect& effect);

// A level of speckle in a strip of one column or of even width: mean electrons without speckle's
// part and of the laser's light, times `factor` at the level.
struct StripLevel {
  const Image<double>& steady;
  const Image<double>& laser;
  const Image<double>& factor;
  // Of every row: contrast squared of the pixels, correlation of neighbours.
  const std::vector<double>& contrast_squared;
  const std::vector<double>& across_line;
  const std::vector<double>& along_line;
  double full_electrons = 0;  // no pixel holds more
};

// `electrons` of that level after an effect that spreads by charge (`SpreadsByCharge`), a flow of
// which every part is quadratic in the charge of one pixel. Neighbours have the root mean square
// they have given this pixel's level f: of bivariate gamma numbers of correlation r the other's
// mean is 1 + r (f - 1), its variance c ((1 - r)^2 + 2 r (1 - r) f) (Kibble, Sankhya 5 (1941) 137).
// On average over the levels as much flows as between pixels that are as bright as each other.
Image<double> SpreadGivenLevel(const Image<double>& electrons, const StripLevel& level,
                               const ActiveEffect& effect, const FrameSetup& frame);

// Of the four pixels of a cell of the colour filter (by rows; all four alike without one), the one
// with most of `electrons`.
int BrightestCell(const Image<double>& electrons);

// Speckle of the four pixels of a cell after effects have spread `electrons`, the mean charge of a
// strip of one column or of even width; null where nothing spreads.
std::array<std::shared_ptr<const LineSpeckle>, 4> AfterChargeSpread(
    const LineSpeckle& speckle, const Image<double>& electrons, const FrameSetup& frame,
    std::span<const ActiveEffect> effects);

}  // namespace sightline
