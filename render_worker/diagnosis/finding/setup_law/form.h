// SPDX-License-Identifier: Apache-2.0
// Functional forms that FindSetupLaws tries, and the fit of one of them.
#pragma once

#include <Eigen/Dense>
#include <limits>
#include <span>
#include <vector>

#include "render_worker/diagnosis/finding/setup_law/setup_law.h"

namespace sightline::setup_law {

struct Quantity {
  const char* name;
  double SetupAmplitude::*value;
  bool may_be_negative_power;  // false for quantities without a natural scale: times and counts
};

// Values of one quantity relative to a typical value.
struct Scaled {
  const Quantity* quantity = nullptr;
  double typical = 1;
  Eigen::ArrayXd values;
  std::vector<double> exponents, exponents_of_products;
};

struct Power {
  int quantity = 0;  // index of Scaled
  double exponent = 1;
};

enum class Kind { kConstant, kPowers, kExponential, kStep };

struct Form {
  Kind kind = Kind::kConstant;
  std::vector<Power> powers;
  double time_s = 0;  // of an exponential or step
  bool offset = false;
  double choice = 0;  // 2 ln(number of similar forms)
  Eigen::ArrayXd g;
};

// Amplitudes over standard errors, 1 over standard errors.
struct Standardised {
  Eigen::ArrayXd amplitude, weight;
};

struct Fit {
  double factor = 0, offset = 0;
  double scale = 1;
  double description = std::numeric_limits<double>::infinity();
  Eigen::ArrayXd residual;  // standardised
};

// Degrees of freedom of Student's likelihood.
inline constexpr double kFreedom = 4;
inline constexpr int kIterations = 8;
inline constexpr int kFewIterations = 3;  // for the choice among many forms

// Maximum of Student's likelihood by iterative reweighting, for factor, offset and scale. The
// description length is infinite if the form cannot be fitted.
Fit FitForm(const Standardised& data, const Form& form, int iterations = kIterations);

// Product of powers of the quantities relative to their typical values, for `size` amplitudes.
Eigen::ArrayXd Product(const std::vector<Scaled>& quantities, const std::vector<Power>& powers,
                       Eigen::Index size);

// Known quantities that vary among the amplitudes, with the exponents to try.
std::vector<Scaled> UsableQuantities(std::span<const SetupAmplitude> amplitudes);

}  // namespace sightline::setup_law
