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

// Additional time between two scans [s], such as manual work, that the order also minimises.
using TimeBetween = std::function<double(int from, int to)>;

// Chooses joint positions and order of scans for the least time: the slowest joint of every
// move plus `between`. Moves are straight in joint space if these touch nothing, otherwise
// by home. A move that is blocked both ways counts 1000 s extra in the order and has a
// remark. The stage may stay at the end of the last scan or go to the start of the next
// one, so moves are checked against both. The first `locked` scans stay first in their
// order. The result is never slower than the given order. Unreachable scans take no time,
// and come last unless they are locked. If interrupted, some moves are unchecked, as their
// remarks state.
std::vector<RobotMove> SequenceScans(const RobotCell& cell, std::span<const ScanToReach> scans,
                                     int locked, const TimeBetween& between,
                                     const std::atomic<bool>* interrupted);

}  // namespace sightline
