// SPDX-License-Identifier: Apache-2.0
// What reflectance that is a random field along the plate does to blocks of the line.
#pragma once

#include <string_view>
#include <vector>

#include "render_worker/frame/frame_setup.h"

namespace sightline {

// Of `columns_px` columns of the image, on the plate [m].
double LengthOnPlate(const FrameSetup& frame, int columns_px);

// True for the effects that have a texture law: surface.albedo_texture, whose correlation is
// exp(-r^2/l^2), and the free-form unknown.reflectance_scatter: exp(-|X|/l) along the line.
bool IsTexture(std::string_view effect_id);

class TextureLaw {
 public:
  // `parameters`: of the effect; standard deviation, relative, and correlation length l [m].
  TextureLaw(std::string_view effect_id, const FrameSetup& frame,
             const std::vector<double>& parameters);

  // Covariance of the mean reflectances, relative, of two stretches of the line of equal length
  // whose middles are `distance_m` apart; averaged over the width of the line too.
  double Covariance(double length_m, double distance_m) const;
  // Relative variance of the light along a stretch of the line about its mean there, over all
  // realisations.
  double VarianceAlong(double length_m) const;
  // Standard deviation between realisations of the same within one: few lengths of the field fit
  // into a stretch. Isserlis' theorem: of x'Ax, x normal with covariance C, 2 tr(ACAC).
  double DeviationOfVarianceAlong(double length_m) const;

 private:
  double CorrelationIntegratedTwice(double distance_m) const;

  bool gaussian_ = false;
  double variance_ = 0;  // of a point of the line
  double correlation_m_ = 0;
};

}  // namespace sightline
