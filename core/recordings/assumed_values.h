// SPDX-License-Identifier: Apache-2.0
// Completes the description of recordings: a value that is not stated gets a usual value and a
// standard uncertainty wide enough for anything usual, so that the recordings determine it.
#pragma once

#include <string>
#include <vector>

#include "sightline/v1/recording.pb.h"

namespace sightline {

// Fills in unstated values of a set of a plate (format versions 1 and 3), with wide uncertainties;
// other messages stay as they are. Version 3 also lacks, if need be, pixel pitch, focal length,
// exposure times, f-numbers and plate positions. Values that nothing can replace (sizes, bits,
// pixel pitch, focal length, wavelength, exposure times, f-numbers, distances of the camera, plate
// positions) are left missing, for ParseRecordings to name. Returns a sentence for every
// assumption, with field, value and standard uncertainty.
std::vector<std::string> AssumeMissingValues(v1::Recordings* message);

}  // namespace sightline
