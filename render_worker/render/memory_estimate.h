// SPDX-License-Identifier: Apache-2.0
// Estimates the memory of an image before it is rendered.
#pragma once

#include <cstdint>
#include <string>

#include "absl/status/status.h"
#include "render_worker/frame/frame_setup.h"
#include "render_worker/frame/ideal_image.h"

namespace sightline {

// Total size in bytes of the largest buffers of one frame: light at the sub-pixels of the laser
// grid, other light at its own grid, electrons and raw values of the pixels.
int64_t FrameBytes(const SubPixelGrid& laser_grid, const SubPixelGrid& incoherent_grid,
                   int channels);

// The same before any optics are computed, with the sub-pixels that the pupil needs and no margin.
int64_t EstimateFrameBytes(const FrameSetup& frame);

// RESOURCE_EXHAUSTED, reason IMAGE_TOO_LARGE, if `bytes` exceeds the limit; the message states the
// required memory and its arrays. `context` names the frame.
absl::Status CheckFrameBytes(int64_t bytes, int64_t max_bytes, const FrameSetup& frame,
                             int sub_pixels, const std::string& context);

// Sub-pixels per pixel and axis of the laser grid: frame.sub_pixels, or as many as the pupil needs.
int SubPixelsOf(const FrameSetup& frame);

}  // namespace sightline
