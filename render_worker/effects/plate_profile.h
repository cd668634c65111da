// SPDX-License-Identifier: Apache-2.0
// A function of the plate, tabulated across the line so that it can be spread.
#pragma once

#include <vector>

#include "render_worker/frame/frame_setup.h"
#include "render_worker/plate/plate_scene.h"

namespace sightline {

// Samples over the region of interest and far beyond; at one X if the function is constant along
// the line, else at places a few pixels apart.
class PlateProfile {
 public:
  // `finest_m`: scale on the plate below which the function, or what is done to it, is smooth.
  PlateProfile(const PlateFunction& function, const FrameSetup& frame, bool constant_along_line,
               double finest_m);

  double step_m() const { return step_m_; }
  // Convolution with exp(-|s|/spread)/(2 spread), exact means of the kernel over the samples.
  void SpreadExponentially(double spread_m);
  // Convolution with symmetric weights, weights[0] at the centre.
  void SpreadBy(const std::vector<double>& weights);

  // Cubic between samples; 0 beyond the ends.
  double At(double x_m, double s_m) const;

 private:
  double AtColumn(size_t column, double s_m) const;

  double first_x_m_ = 0, step_x_m_ = 0;
  double first_s_m_ = 0, step_m_ = 0;
  std::vector<std::vector<double>> columns_;
};

}  // namespace sightline
