// SPDX-License-Identifier: Apache-2.0
// Recordings of a flat plate as an inspection of it.
#pragma once

#include <string>

#include "sightline/v1/inspection.pb.h"
#include "sightline/v1/recording.pb.h"

namespace sightline {

// The plate's mesh, 0.4 m x 0.4 m, as OBJ in metres.
extern const char kPlateObj[];

// An inspection of the plate in the file `part_file` (kPlateObj) with sensor, lens, laser and
// surface of `recordings` (valid, format version 1), set up, focused and exposed as the first
// recording with the laser on (else the first): rendering it needs neither plan nor measurement.
v1::Inspection InspectionOfPlate(const v1::Recordings& recordings, const std::string& part_file);

}  // namespace sightline
