// SPDX-License-Identifier: Apache-2.0
// Variance along a surface normal that errors of calibration cause for all points of a scan.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/triangulation/triangulation.h"
#include "coverage_server/scan/scan_in_part.h"

namespace sightline {

// Errors of camera, sheet and lens displace a point by J e, J the 3 x 14 derivatives of
// core/triangulation. All points of a scan lie on one sheet, which is fixed relative to the camera,
// so J depends on the image position alone: J Sigma^(1/2) is computed on a grid over the image and
// interpolated linearly, and the variance along n is |n' J Sigma^(1/2)|^2. Variances themselves
// must not be interpolated: they fall to 0 where an error has no effect, such as that of the camera
// along its axis on the point in the image's middle.
class CalibrationVariance {
 public:
  // The entries of `covariance` for detection variables must be 0. If all are 0, any() is false.
  CalibrationVariance(const ScanInPart& scan, const TriangulationCovariance& covariance);

  bool any() const { return !grid_.empty(); }
  // Variance [m^2] of a point at `view_m` from the camera (part axes) along the unit `normal`.
  float At(const Eigen::Vector3f& view_m, const Eigen::Vector3f& normal) const;

 private:
  static constexpr int kSide = 9;
  Eigen::Vector3f x_axis_, y_axis_, z_axis_;
  float columns_to_grid_ = 0, rows_to_grid_ = 0;
  // (J Sigma^(1/2))' in part axes [m], row by row of the image.
  using Factor = Eigen::Matrix<float, kTriangulationVariables - kCameraAlpha, 3>;
  std::vector<Factor> grid_;
};

}  // namespace sightline
