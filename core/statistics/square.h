// SPDX-License-Identifier: Apache-2.0
// The square of a number: variances from standard deviations, squared residuals.
#pragma once

namespace sightline {

inline double Square(double x) { return x * x; }

}  // namespace sightline
