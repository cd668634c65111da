// SPDX-License-Identifier: Apache-2.0
// What was fitted on a plate, carried over to the inspection that uses the same camera, lens and
// laser.
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "planner_client/diagnosis_client/inspection_changes.h"
#include "sightline/v1/diagnosis.pb.h"
#include "sightline/v1/inspection.pb.h"
#include "sightline/v1/recording.pb.h"

namespace sightline {

// Fitted deviations and effects of `diagnosis` as values of `inspection`, where it has a field that
// says the same; other effects are named in its `effects`. `nominal`: the description that was
// diagnosed. Sensor, lens and laser are changed only if they are those of the recordings (type and
// size of the sensor, focal length, wavelength), materials only if they are the plate's. Ambient
// light is that which gives the plate the fitted radiance if it comes evenly from everywhere.
// `inspection` has its sensor and materials inline.
CalibratedInspection CalibrateInspection(const v1::Inspection& inspection,
                                         const v1::Recordings& nominal,
                                         const v1::Diagnosis& diagnosis);

// The same of a file. The result has sensor and materials inline and names other files relative to
// `out_folder`, from where it can be read. Errors of reading and of checking the result.
absl::StatusOr<CalibratedInspection> CalibrateInspectionFile(const std::string& path,
                                                             const v1::Recordings& nominal,
                                                             const v1::Diagnosis& diagnosis,
                                                             const std::string& out_folder);

// True: the renderer draws this effect on flat plates only; for parts it refuses it or would leave
// it out.
bool ActsOnPlatesOnly(const std::string& effect);

}  // namespace sightline
