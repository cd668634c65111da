// SPDX-License-Identifier: Apache-2.0
// Expected laser line of a plate recording, in closed form: enough to choose exposures and to
// detect recordings that contradict their description. Images come from the renderer.
#pragma once

#include <array>

#include "core/recordings/recordings.h"

namespace sightline {

// Mean over speckle and noise, without limits of the sensor.
struct ExpectedLine {
  double row_px = 0;    // of the line's centre, from the image's first row, in the middle column
  double width_px = 0;  // standard deviation of its image: beam, diffraction, defocus
  // Photo-electrons of one column, summed across the line, by colour channel.
  std::array<double, 3> electrons_per_column{};
  // Fraction of them in the pixel on the crest.
  double crest_fraction = 0;
  // Squared contrast of the pixels' speckle, (0, 1].
  double speckle_contrast_squared = 1;

  // Above the dark level [DN].
  double CrestDn(const Sensor& sensor, int channel) const {
    return sensor.gain_dn_per_electron * electrons_per_column[channel] * crest_fraction;
  }
};

// `image` as if it were a laser recording of `set` (format version 1). Radiometry as docs/
// recordings.md; the line's image by the optical transfer function: Gaussian beam, diffraction of
// the round pupil and geometric defocus (Hopkins, Proc. R. Soc. A 231, 1955), pixel. Contrast by
// the number of speckles of area lambda^2 b^2 / (pi D^2 / 4) in a pixel (Goodman, Speckle
// Phenomena, 4.7).
ExpectedLine ExpectLine(const RecordingSet& set, const RecordedImage& image);

}  // namespace sightline
