// SPDX-License-Identifier: Apache-2.0
// The expectation of a recording of the plate over speckle and noise, computed without random
// numbers: fast enough to be evaluated thousands of times.
//
// The laser line is long and its optics change slowly along it, so the mean irradiance across the
// line is a convolution in one dimension with the line spread function of the pupil, done at a few
// places along the line. Speckle gives a pixel's irradiance a distribution about its mean
// (SpeckleLevels), over which the sensor's response is averaged. The effects' hooks are those of
// the renderer.
#pragma once

#include <array>
#include <memory>
#include <span>
#include <vector>

#include "render_worker/diagnosis/expectation/expected_light.h"
#include "render_worker/effects/effect.h"
#include "render_worker/recordings/recorded_set.h"
#include "render_worker/speckle/speckle_statistics.h"

namespace sightline {

struct ExpectedFrame {
  FrameSetup frame;  // after the effects on its numbers
  // Mean over the noise at equally likely levels of speckle [DN]; their average is the expected
  // image. Dark frames: one level.
  std::vector<Image<float>> level_dn;
  // Mean and variance over the levels.
  Image<double> mean_dn, level_variance_dn2;
  // Temporal noise variance at the mean level [DN^2].
  Image<float> noise_variance_dn2;
  // Variance of rounding to the raw values that occur [DN^2].
  double rounding_variance_dn2 = 1.0 / 12;
  // Excess kurtosis of the temporal noise, where rounding is coarse; empty: 0 everywhere.
  Image<float> noise_excess_kurtosis;
  // Variance of fixed patterns of the sensor (PRNU, DSNU) at the mean level [DN^2].
  Image<float> pattern_variance_dn2;
  // Standard deviations of random offsets of rows, different in every recording, and of columns,
  // fixed for the sensor [DN].
  double row_scatter_dn = 0, column_scatter_dn = 0;
  Image<double> mean_photo_electrons;          // for the next frame of the burst
  std::shared_ptr<const LineSpeckle> speckle;  // of one pattern; null: no laser light
  // Speckle of the four pixels of a cell of the colour filter if charge spreads; else null.
  std::array<std::shared_ptr<const LineSpeckle>, 4> speckle_of_cell;
  std::shared_ptr<const LineImaging> imaging;  // the same

  // Laser light, relative to its mean, at evenly spaced positions of the segment that the column
  // sample represents; empty: constant.
  std::vector<double> level_along_line;
  // Relative variance of that light within the segment due to random effects and patterns of
  // unknown phase.
  double drawn_variance_along_line = 0;

  // Columns of a mono sensor are equal, or alternate if an effect has `columns_alternate`.
  double MeanDn(int row, int column) const { return mean_dn.At(row, column); }
  // Excess kurtosis k: the variance of the variance of n pixels is its square times (2 + k) / n.
  double NoiseExcessKurtosis(int row, int column) const {
    return noise_excess_kurtosis.empty() ? 0 : noise_excess_kurtosis.At(row, column);
  }
  // Speckle of the pixels of a row; for a colour sensor, that of the given column.
  const SpecklePixelCovariance& SpeckleAt(int row, int column = 0) const;
};

// True if an effect makes odd and even columns of a mono sensor differ.
bool ColumnsAlternate(std::span<const ActiveEffect> effects);

// `frame`: nominal with deviations applied; its region of interest must be so narrow that its
// middle column gives the line's profile. `previous`: mean electrons of the preceding frame in the
// burst, or nullptr. `imaging`, `block_columns_px`: as ExpectLight.
ExpectedFrame ExpectFrame(const FrameSetup& frame, std::span<const ActiveEffect> effects,
                          const Image<double>* previous, std::shared_ptr<const LineImaging> imaging,
                          int speckle_levels, int block_columns_px = 0);

}  // namespace sightline
