// SPDX-License-Identifier: Apache-2.0
// Moments of the pixels of a bin, measured and expected.
#pragma once

#include <cstdint>

#include "render_worker/diagnosis/statistic/set_statistic.h"
#include "render_worker/recordings/profile_bins.h"

namespace sightline {

// Mean raw value of a bin's pixels [DN].
double MeanOfBin(const Image<uint16_t>& raw, const PixelPlane& plane, const ProfileBin& bin);

// Expected variance of a pixel at its mean level: temporal noise plus the sensor's fixed pattern
// [DN^2].
double PixelVariance(const ExpectedFrame& sample, int row, int column);

// Expected excess kurtosis of the temporal noise, averaged over a bin's rows and all segments along
// the line.
double MeanExcessKurtosis(const ExpectedSet& expected, int frame, const PixelPlane& plane,
                          const ProfileBin& bin);

}  // namespace sightline
