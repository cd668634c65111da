// SPDX-License-Identifier: Apache-2.0
// Search for the exposure time with the least cost.
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

// Rounds to four significant digits, as a person sets values; 0 stays 0.
double RoundTo4Digits(double value);

// Exposure times, equally spaced as in the thesis or in a geometric series, rounded to four
// significant digits.
struct ExposureGrid {
  double min_s = 0, max_s = 0;
  int count = 2;
  bool equal_ratios = false;  // min_s > 0

  double At(int index) const;
  // Index of the nearest time of the grid.
  int Nearest(double time_s) const;
};

// The grid for the same exposure at another f-number: times (N/N_0)^2 (thesis eq. 6.4).
ExposureGrid AtFNumber(const ExposureGrid& grid, double grid_f_number, double f_number);

// Costs of some times of the grid, in the order of the indices.
using CostsOfExposures =
    std::function<absl::StatusOr<std::vector<double>>(std::span<const int> indices)>;

// Index of least cost. Evaluates 12 to 24 times in equal ratios first.
// Then it halves the gaps next to the best one (in ratio) until its
// neighbours are adjacent or differ by less than 3 %: 20 to 30 costs
// instead of all. It finds the grid's optimum, up to chance, if the cost
// falls and then rises; ties go to the shorter time. `every`: evaluates
// all costs.
absl::StatusOr<int> SearchExposure(const ExposureGrid& grid, bool every,
                                   const CostsOfExposures& costs);

// Seconds to scan `travel_m` with this total exposure per frame. The stage is slowed down if frame
// time or motion blur require it. 0 if no speed is known and nothing limits it.
double ScanTime(const CostModel& costs, double scan_step_m, const OpticsPlanning& planning,
                double image_speed_px_per_m, double travel_m, double exposure_s);

}  // namespace sightline
