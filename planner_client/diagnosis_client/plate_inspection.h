// SPDX-License-Identifier: Apache-2.0
// Makes an inspection from recordings of a flat plate.
#pragma once

#include <string>

#include "sightline/v1/inspection.pb.h"
#include "sightline/v1/recording.pb.h"

namespace sightline {

// The plate's mesh, 0.4 m x 0.4 m, as OBJ in metres.
extern const char kPlateObj[];

// An inspection of the plate in the file `part_file` (kPlateObj) with sensor, lens, laser and
// surface of `recordings` (valid, format version 1). Set-up, focus and exposure are those of the
// first recording with the laser on (else the first), so that rendering needs no plan or
// measurement.
v1::Inspection InspectionOfPlate(const v1::Recordings& recordings, const std::string& part_file);

}  // namespace sightline
