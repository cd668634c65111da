// SPDX-License-Identifier: Apache-2.0
// Temporal noise of one step, and weighted means over steps.
#pragma once

#include <algorithm>
#include <cmath>

#include "core/statistics/square.h"
#include "render_worker/sensor_diagnosis/flat_field_statistics.h"

namespace sightline {

// Temporal variance of a pixel, from consecutive frames [DN^2].
inline double TemporalVariance(const FlatFieldStatistics& step) {
  return step.noise.variance_1_apart_dn2->value;
}

// Variance of a frame's mean by the temporal noise of its pixels [DN^2].
inline double VarianceOfFrameMean(const FlatFieldStatistics& step) {
  return TemporalVariance(step) / step.pair.pixels;
}

// Mean of values, weighted by the inverse squares of their standard errors.
struct WeightedMean {
  double weight = 0, sum = 0;
  void Add(double value, double error) {
    const double w = 1 / Square(std::max(error, 1e-300));
    weight += w;
    sum += w * value;
  }
  double Mean() const { return sum / weight; }
  double Error() const { return 1 / std::sqrt(weight); }
};

}  // namespace sightline
