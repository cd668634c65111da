// SPDX-License-Identifier: Apache-2.0
// Frames of a checkerboard as a known scanner sees them.
#pragma once

#include <cstdint>
#include <vector>

#include "core/scanner_calibration/rig_adjustment.h"

namespace sightline {

// Standard deviations of what disturbs the frames.
struct SyntheticErrors {
  double corner_px = 0.1, sample_px = 0.05;  // independent
  // Common to a frame: the line's shift and the shift of either end by its turn [px], and the
  // height of the target's corners over a plane [m].
  double line_shift_px = 0, line_turn_px = 0, bend_m = 0;
  // Common to all frames: the board is twisted, z = twist x y, on a flat plate under the line.
  double twist_per_m = 0;
};

struct SyntheticScanner {
  TargetBoard board{7, 6, 0.01};
  Eigen::VectorXd shared;  // truth, SharedParameter
  std::vector<CalibrationFrame> frames;
  std::vector<Eigen::VectorXd> poses;  // truth
  CameraPrior open;                    // an estimated camera: nothing but a start
};

// About 0.3 m away, triangulation angle 37 degrees, board turned by up to 25 degrees. Same seed,
// same frames.
SyntheticScanner MakeSyntheticScanner(int frames, const SyntheticErrors& errors, uint32_t seed);

}  // namespace sightline
