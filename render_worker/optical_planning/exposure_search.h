// SPDX-License-Identifier: Apache-2.0
// Search for the exposure time of least cost.
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/inspection/exposure_limit.h"
#include "core/inspection/inspection.h"

namespace sightline {

// To four significant digits, as a person sets things; 0 stays 0.
double RoundTo4Digits(double value);

// Exposure times, equally spaced as in the thesis or in equal ratios, but for rounding to four
// digits.
struct ExposureGrid {
  double min_s = 0, max_s = 0;
  int count = 2;
  bool equal_ratios = false;  // min_s > 0

  double At(int index) const;
  // Index of the time that is nearest; of those in the grid.
  int Nearest(double time_s) const;
};

// The grid at another f-number: the same exposures, times (N/N_0)^2 (thesis eq. 6.4).
ExposureGrid AtFNumber(const ExposureGrid& grid, double grid_f_number, double f_number);

// Costs of some times of the grid, in the order of the indices.
using CostsOfExposures =
    std::function<absl::StatusOr<std::vector<double>>(std::span<const int> indices)>;

// Index of least cost. A dozen to two dozen times at equal ratios first, then the gaps beside the
// best one are halved (in the ratio of times) until its neighbours are next to it or differ by less
// than 3
// %: twenty to thirty costs instead of all. Finds the grid's optimum where the cost falls and then
// rises, up to chance in its numbers; ties go to the shorter time. `every`: all costs are asked
// for.
absl::StatusOr<int> SearchExposure(const ExposureGrid& grid, bool every,
                                   const CostsOfExposures& costs);

// Seconds to scan `travel_m` with frames of this total exposure: the stage is slowed down where
// frame time or motion blur ask for it. 0 if no speed is known and nothing slows it down.
double ScanTime(const CostModel& costs, double scan_step_m, const OpticsPlanning& planning,
                double image_speed_px_per_m, double travel_m, double exposure_s);

}  // namespace sightline
