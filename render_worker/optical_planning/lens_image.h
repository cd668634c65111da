// SPDX-License-Identifier: Apache-2.0
// The light of a frame through a lens: one image per realisation of the speckle.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "render_worker/image_chain/form_image.h"
#include "render_worker/optical_planning/frame_light.h"

namespace sightline {

// `frame`: the lens setting, after the effects on frames (ApplyFrameEffects); its laser power may
// differ from the one the light was traced with. One image of the pixels per seed. Laser light
// below a thousandth of the line is imaged without speckle: its fluctuation would be no more than
// that of the line's own light anywhere. Without effects the image is made in strips of columns of
// at most an eighth of `max_image_bytes`. Defocus of other light is that of SpreadByDefocus.
// Light from beyond the margin of the light's grid is missing (LensMarginPx says what a setting
// needs). The progress of `limits` is called before every strip of every image, by this thread.
// RESOURCE_EXHAUSTED: more than `max_image_bytes`; CANCELLED.
absl::StatusOr<std::vector<PixelIrradiance>> ImageThroughLens(
    const FrameLight& light, const FrameSetup& frame, std::span<const ActiveEffect> effects,
    std::span<const uint64_t> speckle_seeds, const RenderLimits& limits);

// Margin [px] of the light's grid that ImageThroughLens needs for a setting and depths.
int LensMarginPx(const FrameSetup& frame, std::span<const ActiveEffect> effects,
                 std::span<const double> depths_m);

}  // namespace sightline
