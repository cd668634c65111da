// SPDX-License-Identifier: Apache-2.0
// Images the light of a frame through a lens, once per realisation of the speckle.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "render_worker/image_chain/form_image.h"
#include "render_worker/optical_planning/frame_light.h"

namespace sightline {

// `frame`: the lens setting after the effects on frames (ApplyFrameEffects); its laser power may
// differ from that of the traced light. Returns one image of the pixels per seed. Laser light below
// a thousandth of the line is imaged without speckle: its fluctuation would not exceed that of the
// line's own light anywhere. Without effects, the image is computed in strips of columns with at
// most an eighth of `max_image_bytes`. Other light is defocused by SpreadByDefocus. Light from
// beyond the margin of the light's grid is missing (LensMarginPx gives the margin that a setting
// needs). The progress callback of `limits` is called before every strip of every image, by this
// thread. RESOURCE_EXHAUSTED: more than `max_image_bytes`; CANCELLED.
absl::StatusOr<std::vector<PixelIrradiance>> ImageThroughLens(
    const FrameLight& light, const FrameSetup& frame, std::span<const ActiveEffect> effects,
    std::span<const uint64_t> speckle_seeds, const RenderLimits& limits);

// Margin [px] of the light's grid that ImageThroughLens needs for a setting and depths.
int LensMarginPx(const FrameSetup& frame, std::span<const ActiveEffect> effects,
                 std::span<const double> depths_m);

}  // namespace sightline
