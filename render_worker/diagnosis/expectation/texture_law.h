// SPDX-License-Identifier: Apache-2.0
// Second moments of a texture of the plate along the line. The reflectance is a random field that
// segments of the line average.
#pragma once

#include <vector>

#include "render_worker/effects/effect.h"
#include "render_worker/frame/frame_setup.h"

namespace sightline {

// Length on the plate of `columns_px` columns of the image [m].
double LengthOnPlate(const FrameSetup& frame, int columns_px);

// True for kGaussianReflectance, whose autocorrelation is exp(-r^2/l^2) in both directions, and for
// kExponentialReflectance: exp(-|X|/l) along the line, constant across it.
bool IsTexture(RandomLaw law);

class TextureLaw {
 public:
  // `law`: one that IsTexture. `parameters`: standard deviation, relative, and correlation length l
  // [m] > 0.
  TextureLaw(RandomLaw law, const FrameSetup& frame, const std::vector<double>& parameters);

  // Covariance of the mean reflectances, relative, of two segments of the line of equal length
  // whose centres are `distance_m` apart. The width of the line averages the field, too.
  double Covariance(double length_m, double distance_m) const;
  // Variance of the light along a segment about its mean there, relative, over all realisations.
  double VarianceAlong(double length_m) const;
  // Standard deviation of the same variance between realisations: a segment holds few correlation
  // lengths. Isserlis' theorem: the variance of x'Ax is 2 tr(ACAC) for normal x with covariance C.
  double DeviationOfVarianceAlong(double length_m) const;

 private:
  double CorrelationIntegratedTwice(double distance_m) const;

  bool gaussian_ = false;
  double variance_ = 0;  // of a point of the line
  double correlation_m_ = 0;
};

}  // namespace sightline
