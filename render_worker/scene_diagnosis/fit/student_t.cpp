// SPDX-License-Identifier: Apache-2.0
#include "render_worker/scene_diagnosis/fit/student_t.h"

#include <cmath>
#include <numbers>

namespace sightline {

double LogStudentDensity(double z) {
  return std::lgamma((kStudentFreedom + 1) / 2) - std::lgamma(kStudentFreedom / 2) -
         0.5 * std::log((kStudentFreedom - 2) * std::numbers::pi) -
         (kStudentFreedom + 1) / 2 * std::log1p(z * z / (kStudentFreedom - 2));
}

double StudentWeight(double z_squared) {
  return (kStudentFreedom + 1) / (kStudentFreedom - 2 + z_squared);
}

}  // namespace sightline
