// SPDX-License-Identifier: Apache-2.0
// Sub-pixel position of laser lines in an image, column by column (thesis appendix A).
#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "core/image/image.h"

namespace sightline {

// One crossing of a line with an image column.
struct LinePoint {
  int column_px = 0;
  double row_px = 0;       // sub-pixel, centre of row i is i
  double peak_dn = 0;      // height of the profile above the background
  double width_px = 0;     // standard deviation of the profile along the column
  double ridge_score = 0;  // -second derivative across the ridge [DN/px^2]
  bool saturated = false;  // its profile has a plateau at `saturation_dn`
};

struct LaserLineOptions {
  // Scale of the derivatives [px], about the line's half width / sqrt(3) (Steger 1998), the
  // standard deviation of a Gaussian line. (0.5, 20]. Wide saturated plateaus get their own, larger
  // scale.
  double ridge_sigma_px = 2;
  // Least ridge score [DN/px^2] that makes a line; a Gaussian line of standard deviation
  // ridge_sigma_px and height h [DN] has h / (2^1.5 ridge_sigma_px^2).
  double min_ridge_score_dn = 2;
  // Half width of the window for the position [px]; 0: 4 sigma. The half width of a plateau is
  // added. Between two lines the window ends at the least value.
  int half_window_px = 0;
  // Values >= this one are clipped; <= 0: none are.
  double saturation_dn = 0;
  // Most lines per column, by strength; 1 for a single line.
  int max_lines = 1;
  // Constant background that is subtracted before the centre is computed; NaN: the local background
  // is estimated. The Gaussian fit always fits the background.
  double background_dn = 0;
};

enum class LaserLineMethod {
  // Ridge score by Gaussian derivatives (Steger 1998), then centre of gravity in the column (A.7).
  // The window is centred on the result, sub-pixel, so that cutting a symmetric profile does not
  // shift it, nor does a constant background.
  kStegerCentreOfGravity,
  // Ridge score as above, then a least-squares Gaussian (three parameters and background) to the
  // values of the column; log-parabola start. At clipped values the Gaussian need only be as large.
  kGaussianFit,
};

// Points ordered by column, then by row. A column has no point if it has no line, if the image's
// edge cuts the line so that its position is undetermined, or if the fit does not converge within
// its window. Values that are not finite are interpolated along the column. INVALID_ARGUMENT:
// options outside their ranges, empty image.
absl::StatusOr<std::vector<LinePoint>> DetectLaserLine(const Image<float>& image_dn,
                                                       const LaserLineOptions& options,
                                                       LaserLineMethod method);

}  // namespace sightline
