// Speckle of charge that has moved between pixels: less contrast, longer correlation.
#pragma once

#include <array>
#include <memory>
#include <span>

#include "core/image/image.h"
#include "render_worker/diagnosis/speckle_statistics.h"
#include "render_worker/effects/effect.h"

namespace sightline {

// True for effects that move charge between neighbouring pixels.
bool SpreadsCharge(const Effect& effect);

// Of the four pixels of a cell of the colour filter (by rows; all four alike without one), the one
// with most of `electrons`.
int BrightestCell(const Image<double>& electrons);

// Speckle of the four pixels of a cell after effects have spread `electrons`, the mean charge of a
// strip of one column or of even width; null where nothing spreads.
std::array<std::shared_ptr<const LineSpeckle>, 4> AfterChargeSpread(
    const LineSpeckle& speckle, const Image<double>& electrons, const FrameSetup& frame,
    std::span<const ActiveEffect> effects);

}  // namespace sightline
