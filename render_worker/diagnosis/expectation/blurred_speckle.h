// SPDX-License-Identifier: Apache-2.0
// Speckle of an image that is blurred as a whole after it has formed (by glare, a reflection,
// movement during the exposure): less contrast, longer correlation.
#pragma once

#include <span>
#include <vector>

#include "render_worker/effects/effect.h"
#include "render_worker/speckle/speckle_statistics.h"

namespace sightline {

// `factors`: transfer of the blur, of the irradiance. `before`, `after`: mean irradiance of the
// pixels across the line, the middle of the first of them at first_v_m, without and with the blur.
// Light that comes from beyond 15 rows (4, or 3 columns, if the blur is not only across the line)
// has lost its speckle.
LineSpeckle BlurredSpeckle(const LineSpeckle& speckle, std::span<const TransferFunction> factors,
                           double pixel_pitch_m, double first_v_m,
                           const std::vector<double>& before, const std::vector<double>& after);

}  // namespace sightline
