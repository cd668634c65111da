// SPDX-License-Identifier: Apache-2.0
// Carries a fit to recordings of a plate over to the inspection that uses the same camera, lens and
// laser.
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "planner_client/diagnosis_client/inspection_changes.h"
#include "sightline/v1/diagnosis.pb.h"
#include "sightline/v1/inspection.pb.h"
#include "sightline/v1/recording.pb.h"

namespace sightline {

// Carries the fitted deviations and effects of `diagnosis` over to `inspection`. `nominal`: the
// description that was diagnosed. Deviations change the fields that say the same; effects change
// the fields that the worker states in `inspection_changes`. An effect without such a statement
// becomes one of the inspection's effects, with a warning.
//
// Sensor, lens and laser are changed only if they are those of the recordings (type and size of the
// sensor, focal length, wavelength), materials only if they are the plate's. `inspection` has its
// sensor and materials inline.
CalibratedInspection CalibrateInspection(const v1::Inspection& inspection,
                                         const v1::Recordings& nominal,
                                         const v1::Diagnosis& diagnosis);

// The same of a file. The result has sensor and materials inline and names other files relative to
// `out_folder`, from where it can be read. Errors of reading and of checking the result.
absl::StatusOr<CalibratedInspection> CalibrateInspectionFile(const std::string& path,
                                                             const v1::Recordings& nominal,
                                                             const v1::Diagnosis& diagnosis,
                                                             const std::string& out_folder);

}  // namespace sightline
