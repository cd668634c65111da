// SPDX-License-Identifier: Apache-2.0
// Groups rows of a recording by their distance from the nominal line.
#pragma once

#include <vector>

#include "render_worker/plate/line_width.h"
#include "render_worker/recordings/recorded_set.h"
#include "render_worker/sensor/pixel_planes.h"

namespace sightline {

// Rows of one recording and plane that are averaged together.
struct ProfileBin {
  int plane = 0;
  std::vector<int> rows;
  double centre_px = 0;  // from the nominal line
};

// Bins of one recording, plane by plane, from top to bottom: narrow on the nominal line, wider
// outwards. Dark frames have one bin per plane.
std::vector<ProfileBin> MakeProfileBins(const RecordedFrame& recorded,
                                        const std::vector<PixelPlane>& planes);

// Row of the nominal line in its region.
double NominalLineRow(const FrameSetup& frame);

// Distance from the nominal line beyond which its light is neglected.
double UnlitDistancePx(const FrameSetup& frame);

}  // namespace sightline
