// SPDX-License-Identifier: Apache-2.0
#include "render_worker/material/fresnel.h"

#include <algorithm>
#include <cmath>

namespace sightline {

float SchlickFresnel(float f0, float cosine) {
  const float x = std::clamp(1 - cosine, 0.0F, 1.0F);
  return f0 + (1 - f0) * x * x * x * x * x;
}

float UnpolarisedFresnel(float n, float k, float cosine) {
  // (n + ik)^2 - sin^2 = (a + ib)^2; the reflectances for both polarisations in a and b.
  const double c = std::clamp(static_cast<double>(cosine), 0.0, 1.0);
  const double c2 = c * c;
  const double s2 = 1 - c2;
  const double eta2 = static_cast<double>(n) * n;
  const double k2 = static_cast<double>(k) * k;
  const double real = eta2 - k2 - s2;
  const double modulus = std::sqrt(real * real + 4 * eta2 * k2);  // a^2 + b^2
  const double a = std::sqrt(std::max(0.0, 0.5 * (modulus + real)));
  const double perpendicular = (modulus - 2 * a * c + c2) / (modulus + 2 * a * c + c2);
  const double parallel = perpendicular * (c2 * modulus - 2 * a * c * s2 + s2 * s2) /
                          (c2 * modulus + 2 * a * c * s2 + s2 * s2);
  return static_cast<float>(0.5 * (perpendicular + parallel));
}

}  // namespace sightline
