// SPDX-License-Identifier: Apache-2.0
#include "render_worker/optical_planning/exposure_search.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <map>

#include "core/status/status_macros.h"

namespace sightline {
namespace {

// Number of times evaluated first: at least this many; up to twice as many, no farther apart than
// this ratio.
constexpr int kFirstTimes = 12;
constexpr double kFirstRatio = 1.6;
// Neighbours of the best whose times differ by less than this ratio are near enough.
constexpr double kNearEnough = 1.03;
constexpr int kMostSearchRounds = 32;

}  // namespace

double RoundTo4Digits(double value) {
  if (value == 0 || !std::isfinite(value)) return value;
  const double scale = std::pow(10, 3 - std::floor(std::log10(std::abs(value))));
  return std::round(value * scale) / scale;
}

double ExposureGrid::At(int index) const {
  const double part = static_cast<double>(index) / (count - 1);
  const double exact =
      equal_ratios ? min_s * std::pow(max_s / min_s, part) : min_s + part * (max_s - min_s);
  const double rounded = RoundTo4Digits(exact);
  // Never outside the grid.
  return rounded >= min_s && rounded <= max_s ? rounded : exact;
}

int ExposureGrid::Nearest(double time_s) const {
  const double part = equal_ratios ? std::log(time_s / min_s) / std::log(max_s / min_s)
                                   : (time_s - min_s) / (max_s - min_s);
  return std::clamp(static_cast<int>(std::lround(part * (count - 1))), 0, count - 1);
}

ExposureGrid AtFNumber(const ExposureGrid& grid, double grid_f_number, double f_number) {
  const double ratio = f_number / grid_f_number;
  return {grid.min_s * ratio * ratio, grid.max_s * ratio * ratio, grid.count, grid.equal_ratios};
}

absl::StatusOr<int> SearchExposure(const ExposureGrid& grid, bool every,
                                   const CostsOfExposures& costs) {
  assert(grid.count >= 2);
  std::map<int, double> known;
  const auto ask = [&](std::vector<int> indices) -> absl::Status {
    std::erase_if(indices, [&](int index) { return known.contains(index); });
    std::sort(indices.begin(), indices.end());
    indices.erase(std::unique(indices.begin(), indices.end()), indices.end());
    if (indices.empty()) return absl::OkStatus();
    SIGHTLINE_ASSIGN_OR_RETURN(auto answers, costs(indices));
    for (size_t i = 0; i < indices.size(); ++i) known[indices[i]] = answers[i];
    return absl::OkStatus();
  };
  std::vector<int> first;
  if (every || grid.count <= kFirstTimes) {
    for (int index = 0; index < grid.count; ++index) first.push_back(index);
  } else {
    // In equally spaced grids the shortest times are far apart by ratio anyway.
    const double shortest = std::max(grid.min_s, grid.max_s * (grid.equal_ratios ? 0 : 1e-3));
    const double ratio = grid.max_s / shortest;
    const int times = std::clamp(1 + static_cast<int>(std::log(ratio) / std::log(kFirstRatio)),
                                 kFirstTimes, 2 * kFirstTimes);
    for (int i = 0; i < times; ++i) {
      first.push_back(
          grid.Nearest(shortest * std::pow(ratio, static_cast<double>(i) / (times - 1))));
    }
    first.push_back(0);
  }
  SIGHTLINE_RETURN_IF_ERROR(ask(first));
  const auto best = [&] {
    return std::min_element(known.begin(), known.end(),
                            [](const auto& a, const auto& b) { return a.second < b.second; });
  };
  for (int round = 0; round < kMostSearchRounds && !every; ++round) {
    const auto at = best();
    std::vector<int> between;
    const auto halve = [&](int low, int high) {
      if (high - low < 2) return;
      const double t_low = std::max(grid.At(low), grid.max_s * 1e-6), t_high = grid.At(high);
      if (t_high / t_low < kNearEnough) return;
      between.push_back(std::clamp(grid.Nearest(std::sqrt(t_low * t_high)), low + 1, high - 1));
    };
    if (at != known.begin()) halve(std::prev(at)->first, at->first);
    if (std::next(at) != known.end()) halve(at->first, std::next(at)->first);
    if (between.empty()) break;
    SIGHTLINE_RETURN_IF_ERROR(ask(between));
  }
  return best()->first;
}

double ScanTime(const CostModel& costs, double scan_step_m, const OpticsPlanning& planning,
                double image_speed_px_per_m, double travel_m, double exposure_s) {
  double speed = std::numeric_limits<double>::infinity();
  if (costs.stage_speed_m_per_s) speed = *costs.stage_speed_m_per_s;
  if (costs.frame_rate_hz) speed = std::min(speed, *costs.frame_rate_hz * scan_step_m);
  if (!std::isfinite(speed) && planning.cost_px_per_s == 0) return 0;
  if (exposure_s > 0) {
    // One frame per step, and no more blur than allowed.
    speed = std::min(speed, scan_step_m / exposure_s);
    if (image_speed_px_per_m > 0) {
      speed = std::min(speed, planning.max_motion_blur_px / (image_speed_px_per_m * exposure_s));
    }
  }
  return std::isfinite(speed) ? travel_m / speed : 0;
}

}  // namespace sightline
