// SPDX-License-Identifier: Apache-2.0
// How wide the image of a laser line is.
#pragma once

#include "render_worker/frame/frame_setup.h"

namespace sightline {

// Standard deviation of the nominal line's image [px], roughly: beam, diffraction, defocus.
double NominalWidthPx(const FrameSetup& frame);

// Radius of the disc that a point of the nominal line is blurred to by defocus alone [px].
double DefocusRadiusPx(const FrameSetup& frame);

}  // namespace sightline
