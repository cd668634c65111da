// SPDX-License-Identifier: Apache-2.0
// Carries a fit to recordings of a part over to the inspection that they were made of.
#pragma once

#include "planner_client/diagnosis_client/inspection_changes.h"
#include "sightline/v1/diagnosis.pb.h"
#include "sightline/v1/inspection.pb.h"

namespace sightline {

// The null model `inspection` (sensor and materials inline) with the factors of `diagnosis` and the
// light that its first explanation adds, as the worker states it in `inspection_changes`. An effect
// without such a statement becomes one of the inspection's effects, with a warning.
CalibratedInspection CalibratePartInspection(const v1::Inspection& inspection,
                                             const v1::Diagnosis& diagnosis);

}  // namespace sightline
