// SPDX-License-Identifier: Apache-2.0
#include "render_worker/sensor_diagnosis/departure.h"

#include <boost/math/special_functions/gamma.hpp>

namespace sightline {

double ChiSquaredTailP(double chi_squared, double degrees_of_freedom) {
  return boost::math::gamma_q(degrees_of_freedom / 2, chi_squared / 2);
}

}  // namespace sightline
