// SPDX-License-Identifier: Apache-2.0
// Systematic error of a detected laser line on a curved surface, to second order in the width of
// the laser sheet.
//
// The sheet has a Gaussian profile of standard deviation sigma [m] across its middle, n . X = d.
// The surface is F(X) = 0 with the unit normal N = grad F and the Hessian H [1/m]
// (core/association/surface_curvature.h). In an image column the line of sight of row v meets the
// surface at X(v) = c + z(v) r(v), r = r_0 + v e_y / f, with v = 0 where the middle of the sheet
// meets it. The distance from the middle of the sheet is
//   q(v) = n . X(v) - d = q_1 v + q_2 v^2 / 2 + ...
// and the radiance of a matt surface
//   L(v) ~ exp(-q(v)^2 / (2 sigma^2)) (1 + g v),   g = d ln(cos(incidence of the laser)) / dv.
// With s = sigma / |q_1|, the standard deviation of the line in the image [px], L is a Gaussian
// times 1 + g v - q_2 v^3 / (2 q_1 s^2). Its centre lies at
//   centre of gravity:           s^2 (g - 3/2 q_2 / q_1)  px
//   Gaussian by least squares:   s^2 (g - 3/4 q_2 / q_1)  px
// instead of at 0. On a plane q_2 and g are those of perspective alone, which is negligible.
// Derivatives follow from F(X(v)) = 0:
//   X'  = z' r + z e_y / f,        z'  = -z (N . e_y) / (f N . r),
//   X'' = z'' r + 2 z' e_y / f,    z'' = -(X' . H X' + 2 z' N . e_y / f) / (N . r),
//   q_1 = n . X',  q_2 = n . X'',  g = l . H X' / (l . N),
// with l the direction of the laser light. Gloss, the fan's own change of l, defocus and the
// window of the centre of gravity are left out.
#pragma once

#include <Eigen/Core>

#include "core/rig/rig.h"
#include "core/triangulation/triangulation.h"

namespace sightline {

// Standard deviation [m] across the sheet of the laser's profile, half the 1/e^2 half width
//   w(z) = ((M^2 lambda / (pi delta))^2 + delta^2 (z - z_focus)^2)^1/2.
double SheetDeviation_m(const Laser& laser, double axial_distance_m);

// Places of the line's centre less that of the middle of the sheet, along the image column [px].
struct LineShift {
  double centre_of_gravity_px = 0;
  double gaussian_fit_px = 0;
};

// `position_m`: a point of the surface in the middle of the sheet. `normal` and `hessian_per_m`:
// derivatives of the signed distance there, of either sign. Not finite where the line of sight or
// the laser light lies along the surface.
LineShift LineShiftOnSurface(const TriangulationSetup& setup, const Eigen::Vector3d& position_m,
                             const Eigen::Vector3d& normal, const Eigen::Matrix3d& hessian_per_m,
                             double sheet_deviation_m);

}  // namespace sightline
