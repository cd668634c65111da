// SPDX-License-Identifier: Apache-2.0
// Transfers a fit to recordings of a plate to an inspection with the same camera, lens and
// laser.
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "planner_client/diagnosis_client/inspection_changes.h"
#include "sightline/v1/diagnosis.pb.h"
#include "sightline/v1/inspection.pb.h"
#include "sightline/v1/recording.pb.h"

namespace sightline {

// Transfers the fitted deviations and effects of `diagnosis` to `inspection`. `nominal`: the
// diagnosed description. A deviation changes the field of the same quantity; an effect changes the
// fields that the worker lists in `inspection_changes`. An effect without such a list is added to
// the inspection's effects, with a warning.
//
// Sensor, lens and laser are changed only if they agree with the recordings (type and size of the
// sensor, focal length, wavelength); materials only if they are the plate's. `inspection` has its
// sensor and materials inline.
CalibratedInspection CalibrateInspection(const v1::Inspection& inspection,
                                         const v1::Recordings& nominal,
                                         const v1::Diagnosis& diagnosis);

// The same for a file. The result has sensor and materials inline and file names relative to
// `out_folder`, where it will be stored. Errors of reading and of checking the result.
absl::StatusOr<CalibratedInspection> CalibrateInspectionFile(const std::string& path,
                                                             const v1::Recordings& nominal,
                                                             const v1::Diagnosis& diagnosis,
                                                             const std::string& out_folder);

}  // namespace sightline
