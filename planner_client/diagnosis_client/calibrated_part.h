// SPDX-License-Identifier: Apache-2.0
// Transfers a fit to recordings of a part to the inspection of that part.
#pragma once

#include "planner_client/diagnosis_client/inspection_changes.h"
#include "sightline/v1/diagnosis.pb.h"
#include "sightline/v1/inspection.pb.h"

namespace sightline {

// Returns the null model `inspection` (sensor and materials inline) with the factors of `diagnosis`
// and the additional light of its first explanation, as the worker lists it in
// `inspection_changes`. An effect without such a list is added to the inspection's effects, with a
// warning.
CalibratedInspection CalibratePartInspection(const v1::Inspection& inspection,
                                             const v1::Diagnosis& diagnosis);

}  // namespace sightline
