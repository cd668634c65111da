// SPDX-License-Identifier: Apache-2.0
// Scans to ask about: random ones, good ones, and those of greedy plans.
#pragma once

#include <string>
#include <vector>

#include "core/rig/measurement.h"
#include "coverage_server/scene/coverage_scene.h"

namespace sightline::bench {

// Uniform in Table 2.1; of these the ones that the fast evaluator calls feasible and that cover at
// least one target. `tried` may be null; otherwise receives how many were drawn.
std::vector<Measurement> RandomScans(const CoverageScene& scene, size_t count, uint64_t seed,
                                     int64_t* tried = nullptr);

// Each from its own random start by hill climbing on the fast gain: batches of 32 normal steps, the
// best one kept if it is better, the step shrinking; climb i stops after 1 + i % `stages` batches,
// so that gains spread from poor to good.
std::vector<Measurement> ClimbedScans(const CoverageScene& scene, size_t count, int stages,
                                      uint64_t seed);

// Scans of the planner's own greedy particle swarm plan to `goal` of the measurable targets, in
// this process.
std::vector<Measurement> GreedyPlanScans(const CoverageScene& scene, double goal,
                                         int64_t evaluations_per_scan, int64_t seed);

// `count` feasible scans, each one of `scans` moved by a normal step of `step` times the range of
// every parameter.
std::vector<Measurement> Perturbed(const CoverageScene& scene,
                                   const std::vector<Measurement>& scans, size_t count, double step,
                                   uint64_t seed);

// The nine parameters by name with units.
std::string Describe(const Measurement& measurement);

}  // namespace sightline::bench
