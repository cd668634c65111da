// SPDX-License-Identifier: Apache-2.0
// Blue-noise target points on a mesh.
#pragma once

#include <atomic>

#include "absl/status/statusor.h"
#include "core/part/mesh.h"
#include "core/targets/target_set.h"

namespace sightline {

// Targets per spacing^2 of a plane that holds as many as fit (packing density of random sequential
// addition of discs: 0.547 = density * pi / 4 in units of the spacing).
inline constexpr double kTargetsPerSpacing2 = 0.70;

// Poisson-disk sampling of the surface (after Corsini et al. 2012, thesis section 3.2): no two
// targets of the same spacing class are closer (Euclidean, and on sides that face the same way:
// normals within 90 degrees, so that both sides of a thin wall get their points) than their
// spacing, and no place on the surface is farther than 1.06 times that from one. Perpendicular
// faces, as those of a box, each get their own targets. Where regions overlap the smallest spacing
// counts; between places of two spacings the smaller one is kept. Same mesh, sampling and seed:
// same targets. RESOURCE_EXHAUSTED above 2 million targets; INVALID_ARGUMENT for an empty mesh.
// Targets are sorted along a Morton curve (position, then normal octant) so that neighbours are
// near in memory. CANCELLED soon after *cancelled becomes true; may be null.
absl::StatusOr<TargetSet> SampleTargets(const TriangleMesh& mesh, const TargetSampling& sampling,
                                        const std::atomic<bool>* cancelled = nullptr);

}  // namespace sightline
