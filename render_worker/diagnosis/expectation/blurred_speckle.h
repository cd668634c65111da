// SPDX-License-Identifier: Apache-2.0
// Speckle in an image that is blurred after its formation (by glare, a reflection, movement during
// the exposure): contrast decreases and correlation length increases.
#pragma once

#include <span>
#include <vector>

#include "render_worker/effects/effect.h"
#include "render_worker/speckle/speckle_statistics.h"

namespace sightline {

// `factors`: transfer functions of the blur for the irradiance. `before`, `after`: mean irradiance
// without and with the blur, for the pixels across the line; first_v_m: centre of the first one.
// Light from more than 15 rows away (4 rows or 3 columns, if the blur is not only across the line)
// has lost its speckle.
LineSpeckle BlurredSpeckle(const LineSpeckle& speckle, std::span<const TransferFunction> factors,
                           double pixel_pitch_m, double first_v_m,
                           const std::vector<double>& before, const std::vector<double>& after);

}  // namespace sightline
