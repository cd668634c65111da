// SPDX-License-Identifier: Apache-2.0
// The laser line in a frame of a flat target, and how much its detected centre scatters.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/image/image.h"
#include "core/scanner_calibration/target_camera.h"

namespace sightline {

// Mean of neighbouring crossings of the line.
struct LineSample {
  Eigen::Vector2d image_px;  // pixel centres at whole numbers
  double along_px = 0;       // row or column that the line was detected in
};

struct LineInFrame {
  std::vector<LineSample> samples;  // along the line
  // Unit vector across the line on the image; positions are uncertain along it.
  Eigen::Vector2d across = Eigen::Vector2d::UnitX();
  // Standard deviations of one crossing and of one sample about straight pieces of 64 px: image
  // noise and speckle, without slow changes along the line.
  double crossing_sd_px = 0, sample_sd_px = 0;
  bool along_columns = true;    // of the image: the line runs down rather than across
  double clipped_fraction = 0;  // of the crossings
};

// Rows or columns of one sample.
inline constexpr int kSamplePx = 8;

// Detects lines down and across the image (core/laser_line, centre of gravity) and keeps the
// crossings of one straight line in undistorted coordinates: that with the most within 3 px
// (random sample consensus, fixed seed). Other bright areas, such as reflections, are left out.
// `saturation_dn`: values from there on are clipped. INVALID_ARGUMENT says why there is no line.
absl::StatusOr<LineInFrame> FindLineInFrame(const Image<uint16_t>& image, double saturation_dn,
                                            const TargetCamera& camera);

}  // namespace sightline
