// SPDX-License-Identifier: Apache-2.0
// Forms of laws that FindSetupLaws tries, and the fit of one of them.
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
  bool may_be_negative_power;  // not of what has no scale of its own: times and counts
};

// Values of one quantity over a typical one.
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
  double choice = 0;  // 2 ln(number of forms alike)
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
inline constexpr int kFewIterations = 3;  // to choose among many

// Maximum of Student's likelihood by reweighting, for factor, offset and scale. An infinite
// description length: the form cannot be fitted.
Fit FitForm(const Standardised& data, const Form& form, int iterations = kIterations);

// Product of powers of the quantities over their typical values, of `size` amplitudes.
Eigen::ArrayXd Product(const std::vector<Scaled>& quantities, const std::vector<Power>& powers,
                       Eigen::Index size);

// Quantities that are known and differ among the amplitudes, with the exponents that are tried.
std::vector<Scaled> UsableQuantities(std::span<const SetupAmplitude> amplitudes);

}  // namespace sightline::setup_law
