// SPDX-License-Identifier: Apache-2.0
// Times of scans and of the moves between them, and the order with the least moving (the cost
// terms of thesis eq. 2.1).
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "core/inspection/inspection.h"
#include "core/rig/measurement.h"

namespace sightline {

// Time of one scan from its first to its last frame: travel / min(stage speed, frame rate * scan
// step). Unset limits do not limit; 0 when neither is set or last_frame < first_frame.
double ScanTimeS(const CostModel& costs, double scan_step_m, int first_frame, int last_frame);

// Time to move from one scan to the next: the fixed time plus the longer of rotation and
// translation. All axes move at the same time, so each is the largest difference of a single
// parameter over the speed; angles of azimuth, alpha, beta and gamma take the shorter way round.
// Unset costs are 0.
double RepositionTimeS(const CostModel& costs, const Measurement& from, const Measurement& to);

// Sum of RepositionTimeS along an order.
double TotalRepositionTimeS(const CostModel& costs, std::span<const Measurement> scans,
                            std::span<const int> order);

// The order of all scans with the least total repositioning time. The first `locked` scans stay
// first in their order. Exact (dynamic programming, Held and Karp 1962) for up to 12 other scans;
// beyond that nearest neighbour from every start, improved by 2-opt and or-opt moves. Costs
// without any repositioning time keep the given order. The way back to the first scan is free.
std::vector<int> OrderScans(const CostModel& costs, std::span<const Measurement> scans,
                            int locked = 0);

// The same by times of the machine: times[i][j] is that of its move from scan i to scan j, first[i]
// that to scan i from where it stands before all scans (empty: free).
std::vector<int> OrderByMoveTimes(std::vector<std::vector<double>> times,
                                  std::span<const double> first, int locked);

}  // namespace sightline
