// SPDX-License-Identifier: Apache-2.0
// A plan as `sightline plan` writes it: poses by core/rig.
#pragma once

#include <Eigen/Core>

#include "core/rig/rig.h"
#include "sightline/v1/plan.pb.h"

namespace sightline {

inline const Eigen::Vector3d kSampleCentre_m(0.03, -0.02, 0.05);

Rig SampleRig();

// Three scans with all nine parameters; the last one measures nothing and has no triggers.
v1::Plan SamplePlan();

}  // namespace sightline
