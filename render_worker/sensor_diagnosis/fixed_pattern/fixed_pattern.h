// SPDX-License-Identifier: Apache-2.0
// The fixed pattern of a camera, from averages of many frames (EMVA 1288 R4.0, clause 8): deviation
// of every pixel from the smooth trend of light or dark current.
#pragma once

#include <optional>
#include <vector>

#include "core/image/image.h"
#include "render_worker/sensor/emva1288_measurement.h"
#include "render_worker/sensor_diagnosis/sensor_frames.h"

namespace sightline {

struct FixedPattern {
  bool dark = true;
  Image<double> deviation = {};  // dark: DN, bright: relative; outliers are replaced
  // Variance of the pixels of `deviation` without outliers, and the part of it that is residual
  // temporal noise of the average.
  double variance = 0, noise_variance = 0;
  // Range (maximum minus minimum) of the smooth trend; for bright frames relative to its mean.
  double smooth_range = 0;
  std::vector<int> outliers = {};  // indices of pixels beyond kOutlierDeviations

  // Standard deviation of the pattern without temporal noise, and its standard error.
  Estimate Strength() const;
};

// Limit for outliers in standard deviations: a normal number exceeds it twice in
// 10^9.
inline constexpr double kOutlierDeviations = 6;

// A pattern is material if it exceeds this fraction of the standard deviation of the whole fixed
// pattern. Chosen.
inline constexpr double kMaterialPattern = 0.1;

// Patterns of the dark and of the bright step with most frames, at least kFewestFramesOfPattern and
// hardly any clipped pixels; unset if there are no such steps. The bright pattern requires the dark
// one. Images have at least 8 x 8 pixels.
struct FixedPatterns {
  std::optional<FixedPattern> dark, bright;
};
FixedPatterns FindFixedPatterns(const FlatFieldSteps& steps);

// Means of the deviation over each column, or each row.
std::vector<double> ColumnMeans(const FixedPattern& pattern);
std::vector<double> RowMeans(const FixedPattern& pattern);

}  // namespace sightline
