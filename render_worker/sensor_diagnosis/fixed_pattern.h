// SPDX-License-Identifier: Apache-2.0
// The pattern that every frame of a camera has: columns, rows, periods, single pixels. It is looked
// for in averages of many frames (EMVA 1288 R4.0, clause 8), of which the smooth course of light or
// dark current is taken off first.
#pragma once

#include <string>
#include <vector>

#include "core/image/image.h"
#include "render_worker/sensor/emva1288_measurement.h"
#include "render_worker/sensor_diagnosis/departure.h"

namespace sightline {

struct FixedPattern {
  Image<double> deviation;  // from the smooth course; dark: DN, bright: relative
  // Of single pixels of `deviation`, without pixels far out; and what of it is temporal noise that
  // the average has left.
  double variance = 0, noise_variance = 0;
  // Largest less smallest value of the smooth course; of bright frames relative to its mean.
  double smooth_range = 0;
  std::vector<int> outliers;  // indices of pixels further than six standard deviations out

  // Standard deviation of the pattern, noise taken off, and its standard error.
  Estimate Strength() const;
};

// Averages of `frames` frames each of temporal variance `variance_dn2`; at least 8 x 8 pixels.
FixedPattern DarkPattern(const Image<double>& dark_dn, double variance_dn2, int frames);
// `bright_dn` is brighter than `dark_dn` on average.
FixedPattern BrightPattern(const Image<double>& bright_dn, const Image<double>& dark_dn,
                           double bright_variance_dn2, double dark_variance_dn2, int frames,
                           int dark_frames);

// Column, row, periodic, checkerboard patterns and outlier pixels. Patterns of columns and rows are
// material from a tenth of the whole pattern's standard deviation on.
std::vector<Departure> PatternDepartures(const FixedPattern& pattern, bool dark);

// The smooth course of the light: material above 3 % (the most that EMVA 1288 R4.0, clause 6.2,
// allows).
Departure LightFallOff(const FixedPattern& bright);

// Means of columns (or rows) of the deviation.
std::vector<double> ColumnMeans(const FixedPattern& pattern);
std::vector<double> RowMeans(const FixedPattern& pattern);

}  // namespace sightline
