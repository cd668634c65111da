// SPDX-License-Identifier: Apache-2.0
// Effect of the end of a target's surface on its uncertainty: edges, corners and bends of the part.
//
// Only points on surface with a similar normal inform about a target (thesis 3.4.2). Near an edge
// of the part they lie on one side, and on a thin rib in a strip. This increases the uncertainty
// independently of the scan. It is computed once per target, by inference from points
// on all of the surface that belongs to the target.
#pragma once

#include <array>
#include <atomic>
#include <span>
#include <vector>

#include "core/part/mesh.h"
#include "core/targets/target_set.h"
#include "coverage_server/occlusion/triangle_bvh.h"
#include "coverage_server/uncertainty/target_priors.h"

namespace sightline {

// Uncertainties at which the cost is computed, as fractions of the prior standard deviation.
inline constexpr std::array<double, 2> kExtentLevels = {0.02, 0.002};

// ln(u / u on an endless plane), at the densities that would give an endless plane kExtentLevels.
using ExtentCost = std::array<float, kExtentLevels.size()>;

// Costs of targets [begin, end), written to the same places of `costs` (one per target).
void ComputeExtentCosts(const TriangleMesh& mesh, const TriangleBvh& bvh, const TargetSet& targets,
                        const TargetPriors& priors, double max_normal_angle_rad, size_t begin,
                        size_t end, std::span<ExtentCost> costs,
                        const std::atomic<bool>* cancelled);

}  // namespace sightline
