// SPDX-License-Identifier: Apache-2.0
// Defocus of incoherent light by geometric optics.
#pragma once

#include "core/image/image.h"

namespace sightline {

// Spreads a pinhole image as a lens with a round pupil does: the light of every sample goes
// evenly to the samples of a disc about it, of the radius that `radius_samples` has there. For a
// pupil of radius R and an object whose sharp image is at b' instead of the sensor's b the radius
// is R b |1/b' - 1/b| (thesis eq. 5.5, similar triangles). Energy is kept, except for what leaves
// the image. Where one surface hides another, what the pupil's rim sees beside the edge is missing;
// ray tracing over the pupil has it. Radii are >= 0, those above 1536 count as that; both images of
// one size; same bytes for any number of threads.
Image<float> SpreadByDefocus(const Image<float>& light, const Image<float>& radius_samples,
                             int threads);

}  // namespace sightline
