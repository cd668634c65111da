// SPDX-License-Identifier: Apache-2.0
// A departure from the linear camera model of EMVA 1288 that was looked for in a sensor set.
#pragma once

#include <string>
#include <vector>

namespace sightline {

struct DepartureParameter {
  std::string name, unit;
  double value = 0, standard_error = 0;
};

struct Departure {
  std::string effect;  // id of the vocabulary's effect if there is one
  std::string stage;   // "illumination", "sensor", "readout", "time"
  std::string description = {};
  // Whether the set can show it; if not, `description` says what to record.
  bool testable = true;
  // Probability of at least this much without the departure; of this test alone.
  double p_value = 1;
  // Large enough to matter to somebody who measures with this camera; each test says what that is.
  bool material = false;
  std::vector<DepartureParameter> parameters = {};
};

// Probability that a standard normal number lies at least |z| from zero.
double TwoSidedP(double z);
// Probability that a standard normal number is at least z.
double UpperTailP(double z);
// Probability of a chi squared at least as large.
double ChiSquaredTailP(double chi_squared, double degrees_of_freedom);

}  // namespace sightline
