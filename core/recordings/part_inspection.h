// SPDX-License-Identifier: Apache-2.0
// Reads the inspection of a part back from the description of its recordings.
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "sightline/v1/inspection.pb.h"
#include "sightline/v1/recording.pb.h"

namespace sightline {

// Returns part, lens, laser, materials, lights and sensor of a recordings.json of version 2. It has
// no obstacles, no laser light between surfaces and no unit of the part's file: the caller sets
// part.unit for STL, PLY and OBJ files. File names stay as they are. INVALID_ARGUMENT for format
// version 1, and for regions of interest that differ or lie off the middle of the sensor: the
// principal point of a part's image is its centre.
absl::StatusOr<v1::Inspection> InspectionOfRecordings(const v1::Recordings& recordings,
                                                      const std::string& context);

}  // namespace sightline
