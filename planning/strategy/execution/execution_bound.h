// SPDX-License-Identifier: Apache-2.0
// Lower bounds on the set-ups of a plan and on the time to execute it.
//
// Set-ups. A plan satisfies a target only from a resting face from which some scan measures it. The
// plan's faces therefore partially cover the targets by sets M_r, which face r measures, and every
// face needs at least one set-up. The least number of faces with |union of M_r| >= goal is found
// exactly by enumeration, since parts have few faces.
//
// Time. At least F faces, at least n scans, and the times of CostModel: the sensors are placed
// once, the part is laid F times, and each of the n - F other changes takes at least the shortest
// time of turning, laying and moving the sensors. Scanning itself counts as 0.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "core/targets/target_set.h"
#include "planning/strategy/execution/execution_model.h"

namespace sightline {

struct FaceBound {
  int faces = 1;
  // True if `faces` is the least number; otherwise it is only a lower bound.
  bool exact = true;
  int64_t goal_targets = 0;
};

// Least number of resting faces from which `goal_targets` of the targets in `wanted` are
// measurable. Bit r of measurable_from[t]: target t is measurable from face r. If it is empty,
// faces are unknown and the bound is 1. Not exact if all faces together do not reach the goal.
FaceBound BoundFaces(std::span<const uint64_t> measurable_from, const TargetBits& wanted,
                     int64_t goal_targets);

struct ExecutionBounds {
  int setups = 1;
  bool setups_converged = false;
  std::string setups_statement;
  double time_s = 0;
  bool time_converged = false;
  std::string time_statement;
};

// `scans`: lower bound on the number of scans; `scans_converged`: its search has converged.
ExecutionBounds BoundExecution(const ExecutionModel& model, const FaceBound& faces, int scans,
                               bool scans_converged);

}  // namespace sightline
