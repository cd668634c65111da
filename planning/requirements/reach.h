// SPDX-License-Identifier: Apache-2.0
// Check, before anything is planned, that the rig can measure a surface as well as its tolerances
// require.
#pragma once

#include "absl/status/status.h"
#include "core/inspection/inspection.h"
#include "planning/requirements/requirements.h"

namespace sightline {

// Largest information density [1/m^4] that one scan of the domain gives to an unoccluded surface at
// the origin of the rig that faces between camera and laser: points per area over the variance of
// each along the surface's normal. It is the maximum over some thousand random scans (seeded).
double BestInformationDensity(const Rig& rig, const UncertaintyModel& model,
                              const MeasurementDomain& domain);

// INVALID_ARGUMENT names the first zone out of reach: goal.max_scans repetitions of the best scan
// would give the surface less than a quarter of the information that it needs. The factor of a
// quarter allows for surfaces nearer to the camera than the origin.
absl::Status CheckReach(const Inspection& inspection, const Requirements& requirements);

}  // namespace sightline
