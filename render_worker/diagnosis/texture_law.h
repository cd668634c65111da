// What albedo texture, a random field of correlation exp(-r^2/l^2), does to blocks of the line.
#pragma once

#include <vector>

#include "render_worker/frame/frame_setup.h"

namespace sightline {

// Of `columns_px` columns of the image, on the plate [m].
double LengthOnPlate(const FrameSetup& frame, int columns_px);

// `parameters`: of surface.albedo_texture. Covariance of the mean reflectances, relative, of two
// stretches of the line of equal length whose middles are `distance_m` apart; averaged over the
// width of the line too.
double TextureCovariance(const FrameSetup& frame, const std::vector<double>& parameters,
                         double length_m, double distance_m);

// Relative variance of the light along a stretch of the line about its mean there, over all
// realisations.
double TextureVarianceAlong(const FrameSetup& frame, const std::vector<double>& parameters,
                            double length_m);

}  // namespace sightline
