// SPDX-License-Identifier: Apache-2.0
// What was fitted on recordings of a part, carried over to the inspection they were made of.
#pragma once

#include "planner_client/diagnosis_client/inspection_changes.h"
#include "sightline/v1/diagnosis.pb.h"
#include "sightline/v1/inspection.pb.h"

namespace sightline {

// The null model `inspection` (sensor and materials inline) with the factors of `diagnosis` and the
// light that its first explanation adds: light between surfaces is switched on, light from all
// around becomes lighting.ambient, glare one of the effects. A factor of light between surfaces
// other than 1 and stray light of the projector have no field: a warning.
CalibratedInspection CalibratePartInspection(const v1::Inspection& inspection,
                                             const v1::Diagnosis& diagnosis);

}  // namespace sightline
