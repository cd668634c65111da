// SPDX-License-Identifier: Apache-2.0
// Charge that comes from elsewhere in its column (smear, blooming), and how it scatters.
#pragma once

#include <span>
#include <vector>

#include "core/image/image.h"
#include "render_worker/effects/effect.h"
#include "render_worker/speckle/speckle_statistics.h"

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

bool IsBlooming(const ActiveEffect& active);

// What overflows comes from many rows too, while every level of speckle takes them to be as bright.
// `without`, `with`: mean electrons at all levels before and after blooming; `with` is corrected.
void EvenOutOverflow(const ActiveEffect& blooming, const FrameSetup& frame,
                     const LineSpeckle& speckle, const std::vector<Image<double>>& without,
                     std::vector<Image<double>>& with);

}  // namespace sightline
