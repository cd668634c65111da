// SPDX-License-Identifier: Apache-2.0
#include "render_worker/sensor_diagnosis/departure.h"

#include <boost/math/special_functions/gamma.hpp>
#include <cmath>
#include <numbers>

namespace sightline {

double TwoSidedP(double z) { return std::erfc(std::abs(z) / std::numbers::sqrt2); }

double UpperTailP(double z) { return 0.5 * std::erfc(z / std::numbers::sqrt2); }

double ChiSquaredTailP(double chi_squared, double degrees_of_freedom) {
  return boost::math::gamma_q(degrees_of_freedom / 2, chi_squared / 2);
}

}  // namespace sightline
