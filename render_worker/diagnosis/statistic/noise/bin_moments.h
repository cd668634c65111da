// SPDX-License-Identifier: Apache-2.0
// Moments of the pixels of a bin, measured and expected.
#pragma once

#include <cstdint>

#include "render_worker/diagnosis/statistic/set_statistic.h"
#include "render_worker/recordings/profile_bins.h"

namespace sightline {

// Mean raw value of a bin's pixels [DN].
double MeanOfBin(const Image<uint16_t>& raw, const PixelPlane& plane, const ProfileBin& bin);

// Mean of an expected image over the columns of a plane in a row. Two neighbours stand for all
// columns of a mono sensor, because odd and even ones may differ; one column of a colour sensor
// stands for its plane.
template <typename Value>
double MeanOfColumns(const Image<Value>& values, int row, const PixelPlane& plane) {
  const double first = values.At(row, plane.first_column);
  if (plane.step > 1 || values.columns_px < 2) return first;
  return (first + values.At(row, plane.first_column + 1)) / 2;
}

// Expected variance of a plane's pixels in a row at their mean level: temporal noise plus the
// sensor's fixed pattern [DN^2].
double PixelVariance(const ExpectedFrame& sample, int row, const PixelPlane& plane);

// Expected excess kurtosis of the temporal noise, averaged over a bin's rows and all segments along
// the line.
double MeanExcessKurtosis(const ExpectedSet& expected, int frame, const PixelPlane& plane,
                          const ProfileBin& bin);

}  // namespace sightline
