// SPDX-License-Identifier: Apache-2.0
// Width of a laser line's image.
#pragma once

#include "render_worker/frame/frame_setup.h"

namespace sightline {

// Approximate standard deviation of the nominal line's image [px]: beam, diffraction, defocus.
double NominalWidthPx(const FrameSetup& frame);

// Radius of the disc into which defocus alone blurs a point of the nominal line [px].
double DefocusRadiusPx(const FrameSetup& frame);

}  // namespace sightline
