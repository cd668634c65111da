// SPDX-License-Identifier: Apache-2.0
// Other light through the lens.
#pragma once

#include "render_worker/optics/image_optics.h"

namespace sightline {

// One channel of ApplyOptics: optical transfer function of the pupil at the region's centre and the
// channel's wavelength, transfer functions, vignetting, mean of every pixel's samples (which are
// already means over their sub-pixels).
Image<float> ImageIncoherent(const Image<float>& light, const SubPixelGrid& grid,
                             double wavelength_m, const OpticsModel& optics, int threads);

}  // namespace sightline
