// SPDX-License-Identifier: Apache-2.0
// Sets of plates in poses (format version 3), rendered exactly: every point of the tilted plate has
// its own depth, light and view.
#pragma once

#include <cstdint>
#include <vector>

#include "core/image/image.h"
#include "core/recordings/recordings.h"
#include "render_worker/effects/effect.h"
#include "render_worker/recordings/recorded_set.h"

namespace sightline {

struct PosedSetOptions {
  int poses = 8;
  bool along_columns = false;  // camera turned by 90 degrees about its axis
  bool dark_frames = true;     // and exposures stated
  double crest_share = 0.35;   // of the brightest line in the largest number
};

// Mono sensor of 8 bits, 640 x 480 px. Plates tilted by up to 20 degrees about the line and 12
// degrees along it, 0.28 to 0.32 m away. Exposure times are such that the line has `crest_share`.
RecordingSet PosedSet(const PosedSetOptions& options);

// Images of the set. Effects act as in the renderer.
std::vector<Image<uint16_t>> RenderPosedSet(const RecordingSet& set,
                                            const std::vector<ActiveEffect>& effects,
                                            uint64_t seed);

// Mean photo-electrons of one recording without speckle.
Image<double> MeanElectronsOf(const RecordingSet& set, int index);

// Rendered, reduced, and taken as the diagnosis takes it.
RecordedSet ReducedPosedSet(const RecordingSet& set, const std::vector<ActiveEffect>& effects,
                            uint64_t seed);

}  // namespace sightline
