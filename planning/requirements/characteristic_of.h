// SPDX-License-Identifier: Apache-2.0
// The surfaces that a toleranced feature and its datums consist of, on the targets of a plan.
#pragma once

#include <cstdint>
#include <vector>

#include "absl/status/statusor.h"
#include "core/conformance/characteristic.h"
#include "core/targets/target_set.h"
#include "planning/requirements/requirements.h"

namespace sightline {

struct BoundCharacteristic {
  Characteristic characteristic;  // targets are indices into `targets`
  std::vector<uint32_t> targets;  // of the plan: of the feature, then those of datums alone
  size_t own_targets = 0;         // those of the feature
};

// Faces on one nominal surface within 10 um form one surface. Two parallel planes with opposite
// normals form a width where location or orientation is toleranced. At most `most_targets` are
// taken, evenly from all surfaces, but at least kFewestFeatureTargets of each surface that has so
// many. UNIMPLEMENTED if a datum binds no face, or if a fitted surface has too few targets; the
// message names it.
absl::StatusOr<BoundCharacteristic> BindCharacteristic(const TolerancedFeature& feature,
                                                       const Requirements& requirements,
                                                       const TargetSet& targets,
                                                       size_t most_targets);

}  // namespace sightline
