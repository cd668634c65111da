// SPDX-License-Identifier: Apache-2.0
// Converts the description of a plate recording into the simulated frame.
#pragma once

#include <cstdint>
#include <functional>

#include "core/recordings/recordings.h"
#include "render_worker/frame/frame_setup.h"
#include "render_worker/plate/plate_scene.h"

namespace sightline {

struct PlateFrameOptions {
  SetupDeviation deviation;  // true minus nominal
  uint64_t seed = 1;
  bool speckle = true;
};

// Recording `index` of a set of a plate. Speckle depends only on seed and plate position, noise on
// seed and index. For version 3, `plate` only contains the depth in the middle of the line.
FrameSetup PlateFrame(const RecordingSet& set, int index, const PlateFrameOptions& options);

// The plate of the recording before effects. For version 3 it is the exact tilted plate: deviations
// of distances, angles and the line's position do not change it, and laser_plane.origin_m must be
// set.
std::function<PlateScene(const FrameSetup&)> PlateOf(const RecordingSet& set, int index);

}  // namespace sightline
