// SPDX-License-Identifier: Apache-2.0
// Goodness of fit for tests.
#pragma once

#include <cmath>
#include <cstddef>
#include <vector>

namespace sightline {

// Upper tail of the chi-squared law (Wilson and Hilferty 1931; good to some per cent of p).
inline double ChiSquaredTail(double chi_squared, double degrees_of_freedom) {
  const double v = 2 / (9 * degrees_of_freedom);
  const double z = (std::cbrt(chi_squared / degrees_of_freedom) - (1 - v)) / std::sqrt(v);
  return 0.5 * std::erfc(z / std::sqrt(2.0));
}

// p-value of counts against expected counts; neighbours are joined until 10 are expected.
inline double GoodnessOfFit(const std::vector<double>& counts,
                            const std::vector<double>& expected) {
  double chi_squared = 0, count = 0, sum = 0;
  double bins = 0;
  for (size_t i = 0; i < counts.size(); ++i) {
    count += counts[i];
    sum += expected[i];
    double rest = 0;
    for (size_t j = i + 1; j < expected.size() && rest < 10; ++j) rest += expected[j];
    if (sum < 10 || (rest < 10 && i + 1 < counts.size())) continue;
    chi_squared += (count - sum) * (count - sum) / sum;
    ++bins;
    count = sum = 0;
  }
  return ChiSquaredTail(chi_squared, bins - 1);
}

}  // namespace sightline
