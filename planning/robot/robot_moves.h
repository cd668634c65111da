// SPDX-License-Identifier: Apache-2.0
// The moves of an arm between scans: which of its positions it takes, and in which order.
#pragma once

#include <atomic>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "planning/robot/robot_cell.h"

namespace sightline {

struct ScanToReach {
  Measurement measurement;
  ScanTravel travel;
};

struct RobotMove {
  int scan = 0;  // index of the scan that was given
  bool reachable = false;
  ScanPosition position;   // if reachable
  double move_time_s = 0;  // from the scan before, or from home
  std::string because;     // why it is not reachable
  std::string remark;      // unusual facts about the move; empty: none
};

// Other time between two scans that the order is to consider as well [s]: by hand, say.
using TimeBetween = std::function<double(int from, int to)>;

// Positions and order with the least time, by the slowest joint of every move plus `between`. Moves
// are straight in joint space if that touches nothing, and else by home; a move for which neither
// is free counts as a thousand seconds more in the order and has a remark. While the arm moves the
// stage stands where the scan before ended or where the next one begins, and the part lies as in
// either; moves are looked at with both. The first `locked` scans stay first in their order. Never
// slower than the given order. Scans that are not reached take no time, and are last unless they
// are locked. Interrupted: a good order, of moves that were not all looked at, which their remarks
// say.
std::vector<RobotMove> SequenceScans(const RobotCell& cell, std::span<const ScanToReach> scans,
                                     int locked, const TimeBetween& between,
                                     const std::atomic<bool>* interrupted);

}  // namespace sightline
