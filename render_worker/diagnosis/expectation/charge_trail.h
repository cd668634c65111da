// SPDX-License-Identifier: Apache-2.0
// Charge that a pixel gets from elsewhere in its column (smear, blooming), and its variance.
#pragma once

#include <span>
#include <vector>

#include "core/image/image.h"
#include "render_worker/effects/effect.h"
#include "render_worker/speckle/speckle_statistics.h"

namespace sightline {

// True for effects that add a share of the column's sum to every pixel.
bool IsSmear(const ActiveEffect& active);

// Charge added by smear: a sum over the column, in which speckle averages out in part.
struct SmearTrail {
  Image<double> laser, steady;  // mean electrons; empty: no smear
  int crest_row = 0;            // row of the brightest line
  double contrast_kept = 0;     // of the column's sum over that of a pixel
};

// `total`: mean electrons of all light; `steady`: those of light other than the laser's. `speckle`:
// null without laser light.
SmearTrail TrailOfSmear(const Image<double>& total, const Image<double>& steady,
                        const FrameSetup& frame, std::span<const ActiveEffect> effects,
                        const LineSpeckle* speckle);

// True for effects that let charge above a threshold overflow along the column.
bool IsBlooming(const ActiveEffect& active);

// Reduces the variance of overflowed charge over the levels. This charge comes from many rows,
// whose speckle averages out, whereas each level assumes equally bright rows. `without`, `with`:
// mean electrons at all levels before and after blooming; `with` is corrected.
void EvenOutOverflow(const ActiveEffect& blooming, const FrameSetup& frame,
                     const LineSpeckle& speckle, const std::vector<Image<double>>& without,
                     std::vector<Image<double>>& with);

}  // namespace sightline
