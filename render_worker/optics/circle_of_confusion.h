// SPDX-License-Identifier: Apache-2.0
// Defocus of incoherent light by geometric optics.
#pragma once

#include "core/image/image.h"

namespace sightline {

// Spreads a pinhole image as a lens with a round pupil does: the light of every sample is
// distributed evenly over the samples of a disc around it, with the radius that `radius_samples`
// has there. For a pupil of radius R and an object with the sharp image at b' instead of the
// sensor's b, the radius is R b |1/b' - 1/b| (thesis eq. 5.5, similar triangles). Energy is
// conserved except for light that leaves the image. At occluding edges the light that only the
// pupil's rim sees is missing; ray tracing over the pupil contains it. Radii are >= 0 and limited
// to 1536; both images have the same size; the bytes do not depend on the number of threads.
Image<float> SpreadByDefocus(const Image<float>& light, const Image<float>& radius_samples,
                             int threads);

}  // namespace sightline
