// SPDX-License-Identifier: Apache-2.0
// Robust distribution of standardised residuals of block means: Student's t with few degrees of
// freedom, scaled to unit variance. Means over few speckle grains have heavier tails than a normal
// distribution.
#pragma once

namespace sightline {

// Degrees of freedom nu. Chosen between the exponential tail of one speckle grain and the normal
// tail of many.
inline constexpr double kStudentFreedom = 6;

// Log density at z [nats]:
//   log Gamma((nu + 1)/2) - log Gamma(nu/2) - log(pi (nu - 2))/2 - (nu + 1)/2 log(1 + z^2/(nu -
//   2)).
double LogStudentDensity(double z);

// Weight of a residual z in iteratively reweighted least squares, (nu + 1) / (nu - 2 + z^2), as a
// function of z^2.
double StudentWeight(double z_squared);

}  // namespace sightline
