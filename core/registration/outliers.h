// SPDX-License-Identifier: Apache-2.0
// Points of a scan that do not belong to the surface around them: reflections, mixed pixels at
// edges, dust.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "core/registration/scan_noise.h"
#include "core/registration/surface_deviation.h"

namespace sightline {

struct OutlierRule {
  // Side of the cubes within which the deviation of the surface is nearly constant [m].
  double cell_m = 0.0012;
  // An outlier differs from the median deviation of its cube by more than this number of standard
  // deviations. For a normal distribution one value in 5e8 lies beyond six.
  double most_deviations = 6;
};

// For every point, 1 if it is an outlier. The deviations from the model of all points within a cube
// are compared with their median (Hampel's identifier, Technometrics 13(2), 1971). Their standard
// deviation is 1.4826 times the median absolute deviation, but no less than the noise of detection.
// A dent or a wrong place of a whole face moves the median and makes no outliers. Cubes with fewer
// than 5 points are doubled in side, at most twice; if there are still fewer, the points stay.
std::vector<uint8_t> FindOutliers(const PointsOnModel& points, const ScanNoise& noise,
                                  const OutlierRule& rule);

// Removes the points that are marked and returns how many there were.
int64_t RemovePoints(std::span<const uint8_t> marked, PointsOnModel& points);

// For every point, 1 if it repeats an earlier one exactly.
std::vector<uint8_t> FindDuplicates(std::span<const Eigen::Vector3d> positions_m);

}  // namespace sightline
