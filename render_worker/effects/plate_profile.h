// SPDX-License-Identifier: Apache-2.0
// A function on the plate, tabulated across the line for convolutions.
#pragma once

#include <vector>

#include "render_worker/frame/frame_setup.h"
#include "render_worker/plate/plate_scene.h"

namespace sightline {

// Samples cover the region of interest and a wide margin; a single X suffices if the function is
// constant along the line, otherwise several X a few pixels apart.
class PlateProfile {
 public:
  // `finest_m`: scale on the plate below which the function and its convolutions are smooth.
  PlateProfile(const PlateFunction& function, const FrameSetup& frame, bool constant_along_line,
               double finest_m);

  double step_m() const { return step_m_; }
  // Convolution with exp(-|s|/spread)/(2 spread), with exact kernel means over the samples.
  void SpreadExponentially(double spread_m);
  // Convolution with symmetric weights, weights[0] at the centre.
  void SpreadBy(const std::vector<double>& weights);

  // Cubic interpolation; 0 beyond the ends.
  double At(double x_m, double s_m) const;

 private:
  double AtColumn(size_t column, double s_m) const;

  double first_x_m_ = 0, step_x_m_ = 0;
  double first_s_m_ = 0, step_m_ = 0;
  std::vector<std::vector<double>> columns_;
};

}  // namespace sightline
