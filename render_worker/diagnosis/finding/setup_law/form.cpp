// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/finding/setup_law/form.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace sightline::setup_law {
namespace {

constexpr std::array<Quantity, 11> kQuantities = {
    {{"exposure_time_s", &SetupAmplitude::exposure_time_s, true},
     {"f_number", &SetupAmplitude::f_number, true},
     {"camera_distance_m", &SetupAmplitude::camera_distance_m, true},
     {"focus_distance_m", &SetupAmplitude::focus_distance_m, true},
     {"defocus_px", &SetupAmplitude::defocus_px, false},
     {"laser_distance_m", &SetupAmplitude::laser_distance_m, true},
     {"timestamp_s", &SetupAmplitude::timestamp_s, false},
     {"signal_level", &SetupAmplitude::signal_level, true},
     {"burst_frame_index", &SetupAmplitude::burst_frame_index, false},
     {"field_position", &SetupAmplitude::field_position_m, false},
     {"row", &SetupAmplitude::row, false}}};

// A scale of 0.79 is what normal residuals of unit variance have at four degrees of freedom.
constexpr double kLeastScale = 0.79;

}  // namespace

Fit FitForm(const Standardised& data, const Form& form, int iterations) {
  const auto n = static_cast<double>(data.amplitude.size());
  const Eigen::ArrayXd g = form.g * data.weight;
  Fit fit;
  Eigen::ArrayXd robust = Eigen::ArrayXd::Ones(data.amplitude.size());
  for (int iteration = 0; iteration < iterations; ++iteration) {
    const double gg = (robust * g * g).sum(), ga = (robust * g * data.amplitude).sum();
    if (form.offset) {
      const double ww = (robust * data.weight * data.weight).sum();
      const double gw = (robust * g * data.weight).sum();
      const double wa = (robust * data.weight * data.amplitude).sum();
      const double determinant = gg * ww - gw * gw;
      if (!(determinant > 1e-10 * gg * ww)) return fit;
      fit.factor = (ga * ww - wa * gw) / determinant;
      fit.offset = (wa * gg - ga * gw) / determinant;
    } else {
      if (!(gg > 0)) return fit;
      fit.factor = ga / gg;
    }
    fit.residual = data.amplitude - fit.factor * g - fit.offset * data.weight;
    const Eigen::ArrayXd square = fit.residual.square();
    if (iteration == 0) {
      Eigen::ArrayXd sorted = square;
      std::nth_element(sorted.data(), sorted.data() + sorted.size() / 2,
                       sorted.data() + sorted.size());
      fit.scale = std::max(kLeastScale, 1.5 * std::sqrt(sorted[sorted.size() / 2]));
    }
    robust = (kFreedom + 1) / (kFreedom + square / (fit.scale * fit.scale));
    fit.scale = std::max(kLeastScale, std::sqrt((robust * square).sum() / n));
  }
  const double numbers = form.offset ? 2 : 1;
  fit.description =
      (kFreedom + 1) *
          (1 + fit.residual.square() / (kFreedom * fit.scale * fit.scale)).log().sum() +
      2 * n * std::log(fit.scale) + numbers * std::log(n) + form.choice;
  return fit;
}

Eigen::ArrayXd Product(const std::vector<Scaled>& quantities, const std::vector<Power>& powers,
                       Eigen::Index size) {
  Eigen::ArrayXd g = Eigen::ArrayXd::Ones(size);
  for (const Power& power : powers) g *= quantities[power.quantity].values.pow(power.exponent);
  return g;
}

std::vector<Scaled> UsableQuantities(std::span<const SetupAmplitude> amplitudes) {
  std::vector<Scaled> usable;
  for (const Quantity& quantity : kQuantities) {
    Scaled scaled{
        &quantity, 1, Eigen::ArrayXd(static_cast<Eigen::Index>(amplitudes.size())), {}, {}};
    for (size_t i = 0; i < amplitudes.size(); ++i) {
      scaled.values[static_cast<Eigen::Index>(i)] = amplitudes[i].*quantity.value;
    }
    if (!scaled.values.allFinite()) continue;
    const double least = scaled.values.minCoeff(), most = scaled.values.maxCoeff();
    const double size = std::max(std::abs(least), std::abs(most));
    if (!(most - least > 0.02 * size)) continue;
    std::vector<double> distinct(scaled.values.begin(), scaled.values.end());
    std::sort(distinct.begin(), distinct.end());
    distinct.erase(std::unique(distinct.begin(), distinct.end(),
                               [size](double a, double b) { return b - a < 1e-3 * size; }),
                   distinct.end());
    if (least < 0) {
      scaled.typical = size;
      scaled.exponents = {1};
      if (distinct.size() > 2) scaled.exponents.push_back(2);
    } else {
      double log_sum = 0;
      int positive = 0;
      for (const double value : scaled.values) {
        if (!(value > 0)) continue;
        log_sum += std::log(value);
        ++positive;
      }
      scaled.typical = std::exp(log_sum / positive);
      if (distinct.size() == 2) {
        scaled.exponents = {1};
      } else if (least > 0 && quantity.may_be_negative_power) {
        scaled.exponents = {-4, -3, -2, -1.5, -1, -0.5, 0.5, 1, 1.5, 2, 3, 4};
        scaled.exponents_of_products = {-4, -2, -1, -0.5, 0.5, 1, 2, 4};
      } else {
        scaled.exponents = {0.5, 1, 1.5, 2, 3};
        scaled.exponents_of_products = {0.5, 1, 2};
      }
    }
    scaled.values /= scaled.typical;
    usable.push_back(std::move(scaled));
  }
  return usable;
}
}  // namespace sightline::setup_law
