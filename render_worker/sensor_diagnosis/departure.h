// SPDX-License-Identifier: Apache-2.0
// A tested departure of a sensor set from the linear camera model of EMVA 1288, and p-values of the
// tests.
#pragma once

#include <string>
#include <vector>

namespace sightline {

struct DepartureParameter {
  std::string name, unit;
  double value = 0, standard_error = 0;
};

struct Departure {
  std::string effect;            // its name (departure_names.h)
  std::string stage;             // "illumination", "sensor", "readout", "time"
  std::string description = {};  // with the size, for people
  // False: the set cannot show it, and `description` states what to record.
  bool testable = true;
  // Probability of a test statistic at least as large without the departure; of this test alone.
  double p_value = 1;
  // True if it is large enough to matter for measurements; each test states its threshold.
  bool material = false;
  std::vector<DepartureParameter> parameters = {};
};

// Probability of a chi squared at least as large.
double ChiSquaredTailP(double chi_squared, double degrees_of_freedom);

}  // namespace sightline
