// SPDX-License-Identifier: Apache-2.0
// From the description of a plate recording to the frame that is simulated.
#pragma once

#include <cstdint>

#include "core/recordings/recordings.h"
#include "render_worker/frame/frame_setup.h"

namespace sightline {

struct PlateFrameOptions {
  SetupDeviation deviation;  // true minus nominal
  uint64_t seed = 1;
  bool speckle = true;
};

// Recording `index` of a set of format version 1. Speckle depends on seed and plate position only,
// noise on seed and index.
FrameSetup PlateFrame(const RecordingSet& set, int index, const PlateFrameOptions& options);

}  // namespace sightline
