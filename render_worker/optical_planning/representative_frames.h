// SPDX-License-Identifier: Apache-2.0
// Frames that stand for all frames of a scan.
#pragma once

#include <vector>

#include "render_worker/optical_planning/frame_light.h"

namespace sightline {

struct Representatives {
  struct Frame {
    int index = 0;      // among the glances
    double weight = 0;  // share of all lit samples it stands for; the sum is 1
  };
  std::vector<Frame> frames;  // by index
  // The frame least like the one that stands for it; -1: none differs.
  int farthest = -1;
  // Share of the variance between frames that lies between the groups; 1: frames of a group are
  // alike.
  double represented_fraction = 1;
};

// Groups frames by the features that a camera setting must suit: line length, light on the line and
// its spread, depth and its spread, each divided by its standard deviation over the scan, frames
// weighted by line length. k-medoids (Kaufman and Rousseeuw 1987), begun with the frame that is
// nearest to all and then those farthest from what is chosen; every group is stood for by its
// medoid. At most `count` groups; frames without light stand for nothing. Empty: no frame has
// light.
Representatives ChooseRepresentatives(const std::vector<FrameGlance>& glances, int count);

}  // namespace sightline
