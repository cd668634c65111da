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
// step). Unset limits do not limit; 0 when neither is set or last_frame < first_frame.
double ScanTimeS(const CostModel& costs, double scan_step_m, int first_frame, int last_frame);

// Time to move from one scan to the next: the sum of TimesBetween. The speeds of CostModel
// count for the longer of rotation and translation: all axes move at the same time, so each is the
// largest difference of a single parameter over the speed; angles of azimuth, alpha, beta and gamma
// take the shorter way round. Unset costs are 0.
double RepositionTimeS(const ExecutionModel& model, const Measurement& from, const Measurement& to);

// Sum of RepositionTimeS along an order.
double TotalRepositionTimeS(const ExecutionModel& model, std::span<const Measurement> scans,
                            std::span<const int> order);

// The order of all scans with the least total repositioning time. The first `locked` scans stay
// first in their order. Exact (dynamic programming, Held and Karp 1962) for up to 12 other scans.
// Beyond that, where set-ups cost time, set-ups are put in order first and then the scans of each,
// both exactly up to 12; otherwise, and for more, nearest neighbour from every start, improved by
// 2-opt and or-opt moves. Scans of a set-up follow one another unless another order takes less
// time. If only a fixed time per scan has a cost, or nothing, all orders take the same time and
// the given one is kept. The way back to the first scan is not counted.
std::vector<int> OrderScans(const ExecutionModel& model, std::span<const Measurement> scans,
                            int locked = 0);

// The same by times of the machine: times[i][j] is that of its move from scan i to scan j, first[i]
// that to scan i from where it stands before all scans (empty: free).
std::vector<int> OrderByMoveTimes(std::vector<std::vector<double>> times,
                                  std::span<const double> first, int locked);

}  // namespace sightline
