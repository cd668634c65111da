// SPDX-License-Identifier: Apache-2.0
// Whether the rig can know a surface as well as its tolerances ask, said before anything is
// planned.
#pragma once

#include "absl/status/status.h"
#include "core/inspection/inspection.h"
#include "planning/requirements/requirements.h"

namespace sightline {

// Most information density [1/m^4] that one scan of the domain brings to a surface at the origin of
// the rig, which faces between camera and laser and hides behind nothing: points per area over the
// variance of each along the surface's normal, the largest of some thousand scans (seeded).
double BestInformationDensity(const Rig& rig, const UncertaintyModel& model,
                              const MeasurementDomain& domain);

// INVALID_ARGUMENT, naming the narrowest zone that is out of reach: if even goal.max_scans of the
// best scan, all of the same surface, would bring less than a quarter of the information that it
// needs. A quarter, since a surface may come nearer to the camera than the origin.
absl::Status CheckReach(const Inspection& inspection, const Requirements& requirements);

}  // namespace sightline
