// Rows of a recording that belong together: by distance from the nominal line.
#pragma once

#include <vector>

#include "render_worker/diagnosis/recorded_set.h"

namespace sightline {

// Pixels of one kind: all of a mono sensor, or one of the four of a Bayer cell.
struct PixelPlane {
  int first_row = 0;
  int first_column = 0;
  int step = 1;
};

// Rows of one recording and plane that are averaged together.
struct ProfileBin {
  int plane = 0;
  std::vector<int> rows;
  double centre_px = 0;  // from the nominal line
};

// The planes of a sensor.
std::vector<PixelPlane> PixelPlanes(const Sensor& sensor);

// Bins of one recording, plane by plane, from top to bottom: narrow on the nominal line, growing
// outwards. Dark frames: one bin a plane.
std::vector<ProfileBin> MakeProfileBins(const RecordedFrame& recorded,
                                        const std::vector<PixelPlane>& planes);

// Standard deviation of the nominal line's image, roughly: beam, diffraction, defocus.
double NominalWidthPx(const FrameSetup& frame);

// Row of the nominal line in its region.
double NominalLineRow(const FrameSetup& frame);

// Distance from the nominal line beyond which its light counts as none.
double UnlitDistancePx(const FrameSetup& frame);

// Radius of the disc that a point of the nominal line is blurred to by defocus alone.
double DefocusRadiusPx(const FrameSetup& frame);

}  // namespace sightline
