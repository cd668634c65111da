// SPDX-License-Identifier: Apache-2.0
// Chooses frames that represent all frames of a scan.
#pragma once

#include <vector>

#include "render_worker/optical_planning/frame_light.h"

namespace sightline {

struct Representatives {
  struct Frame {
    int index = 0;      // among the glances
    double weight = 0;  // fraction of all lit samples that it represents; the sum is 1
  };
  std::vector<Frame> frames;  // by index
  // The frame that differs most from its representative; -1: none differs.
  int farthest = -1;
  // Fraction of the variance between frames that lies between the groups; 1: frames of a group are
  // equal.
  double represented_fraction = 1;
};

// Groups frames by the features that a camera setting must suit: line length, light on the line and
// its spread, depth and its spread. Each feature is divided by its standard deviation over the
// scan, and frames are weighted by line length. Method: k-medoids (Kaufman and Rousseeuw 1987),
// initialised with the most central frame and then the frames farthest from those chosen. The
// medoid represents its group. At most `count` groups; frames without light represent nothing.
// Empty if no frame has light.
Representatives ChooseRepresentatives(const std::vector<FrameGlance>& glances, int count);

}  // namespace sightline
