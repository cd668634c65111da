// Charge that smear adds to a frame, and how it scatters.
#pragma once

#include <span>

#include "core/image/image.h"
#include "render_worker/diagnosis/speckle_statistics.h"
#include "render_worker/effects/effect.h"

namespace sightline {

bool IsSmear(const ActiveEffect& active);

// What smear adds gathers the light of a whole column, whose speckle averages out in part.
struct SmearTrail {
  Image<double> laser, steady;  // mean electrons; empty: no smear
  int crest_row = 0;            // where the line is brightest
  double contrast_kept = 0;     // of the column's sum over that of a pixel
};

// Of mean electrons `total`, `steady` of which are not of the laser. `speckle`: null without laser
// light.
SmearTrail TrailOfSmear(const Image<double>& total, const Image<double>& steady,
                        const FrameSetup& frame, std::span<const ActiveEffect> effects,
                        const LineSpeckle* speckle);

}  // namespace sightline
