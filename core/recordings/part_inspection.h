// SPDX-License-Identifier: Apache-2.0
// The inspection behind recordings of a part.
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "sightline/v1/inspection.pb.h"
#include "sightline/v1/recording.pb.h"

namespace sightline {

// The inspection that recordings.json of version 2 describes: part, lens, laser, materials, lights,
// sensor; laser light between surfaces is left out of its render settings, as is everything the
// file does not know (obstacles, unit of the part's file: set part.unit for STL, PLY, OBJ). File
// names are as they stand there. INVALID_ARGUMENT: format version 1; regions that differ or are not
// the middle of the sensor, since a part's image has the principal point in its centre.
absl::StatusOr<v1::Inspection> InspectionOfRecordings(const v1::Recordings& recordings,
                                                      const std::string& context);

}  // namespace sightline
