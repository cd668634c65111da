// SPDX-License-Identifier: Apache-2.0
// Times of scans and of the moves between them, and the order with the least moving (the cost
// terms of thesis eq. 2.1).
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "core/inspection/inspection.h"
#include "core/rig/measurement.h"
#include "planning/strategy/execution/execution_model.h"

namespace sightline {

// Time of one scan from its first to its last frame: travel / min(stage speed, frame rate * scan
// step). Unset limits are ignored; 0 if neither is set or if last_frame < first_frame.
double ScanTimeS(const CostModel& costs, double scan_step_m, int first_frame, int last_frame);

// Time to move from one scan to the next: the sum of TimesBetween. All axes move at the same time:
// the speeds of CostModel apply to the longer of rotation and translation, each the largest
// difference of a single parameter. Azimuth, alpha, beta and gamma take the shorter way round.
// Unset costs are 0.
double RepositionTimeS(const ExecutionModel& model, const Measurement& from, const Measurement& to);

// Sum of RepositionTimeS along an order.
double TotalRepositionTimeS(const ExecutionModel& model, std::span<const Measurement> scans,
                            std::span<const int> order);

// Order of all scans with the least total repositioning time. The first `locked` scans stay first
// in their order. Exact (dynamic programming, Held and Karp 1962) for up to 12 other scans. For
// more, if set-ups cost time, first set-ups and then the scans of each are ordered, both exactly up
// to 12. Otherwise a nearest-neighbour tour from every start is improved by 2-opt and or-opt moves.
// Scans of a set-up are consecutive unless another order takes less time. The given order is kept
// if all orders take the same time: without costs, or with a fixed time per scan only. The way back
// to the first scan is not counted.
std::vector<int> OrderScans(const ExecutionModel& model, std::span<const Measurement> scans,
                            int locked = 0);

// The same with given move times. times[i][j]: from scan i to scan j; first[i]: from the initial
// pose to scan i (empty: 0).
std::vector<int> OrderByMoveTimes(std::vector<std::vector<double>> times,
                                  std::span<const double> first, int locked);

}  // namespace sightline
