// SPDX-License-Identifier: Apache-2.0
#include "render_worker/effects/time/sinusoidal_motion.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numbers>

namespace sightline {
namespace {

constexpr double kTurn = 2 * std::numbers::pi;

// The image's displacements during one exposure, and the transfer function that they make.
class Motion {
 public:
  Motion(double amplitude_m, double periods, double phase) : amplitude_m_(amplitude_m) {
    for (size_t k = 0; k < quarter_.size(); ++k) {
      quarter_[k] = std::sin(kTurn / 4 * (static_cast<double>(k) + 0.5) /
                             static_cast<double>(quarter_.size()));
    }
    const double whole = std::floor(periods);
    for (size_t k = 0; k < remainder_.size(); ++k) {
      remainder_[k] =
          std::sin(phase + kTurn * (periods - whole) * (static_cast<double>(k) + 0.5) / kMoments);
    }
    // An exposure of zero duration: the displacement at that moment.
    whole_share_ = periods > 0 ? whole / periods : 0;
    Tabulate();
  }

  std::complex<double> Transfer(double q_per_m) const {
    const double x = kTurn * q_per_m * amplitude_m_;
    const double place = std::abs(x) / kStep;
    const int below = static_cast<int>(std::min<double>(place, kTabulated));
    if (below >= kTabulated) return Sum(x);
    const std::complex<double> value = Interpolated(below, place - below);
    return x < 0 ? std::conj(value) : value;
  }

 private:
  static constexpr int kMoments = 64;
  // Displacements are amplitudes at most, so that the transfer function is smooth in the turn
  // angle of the amplitude: Lagrange's polynomials through 14 places 1/4 apart are right to 1e-13.
  static constexpr int kPlaces = 14;
  static constexpr int kFirst = 1 - kPlaces / 2;  // of the places, from the step it is in
  static constexpr double kStep = 0.25;
  static constexpr int kTabulated = 1024;  // steps

  // `x`: 2 pi times frequency times amplitude.
  std::complex<double> Sum(double x) const {
    double whole = 0;
    for (const double displacement : quarter_) whole += std::cos(x * displacement);
    std::complex<double> rest = 0;
    for (const double displacement : remainder_) rest += std::polar(1.0, -x * displacement);
    return Mean(whole, rest);
  }

  std::complex<double> Mean(double whole, std::complex<double> rest) const {
    return whole_share_ * whole / static_cast<double>(quarter_.size()) +
           (1 - whole_share_) / kMoments * rest;
  }

  // As Sum, all displacements' phasors turned on from place to place.
  void Tabulate() {
    constexpr int kAll = kMoments / 2 + kMoments;
    std::array<double, kAll> cosine, sine, turned_cosine, turned_sine;
    for (int k = 0; k < kAll; ++k) {
      const double displacement = k < kMoments / 2 ? quarter_[k] : remainder_[k - kMoments / 2];
      const double first = displacement * kStep * kFirst;
      cosine[k] = std::cos(first);
      sine[k] = std::sin(first);
      turned_cosine[k] = std::cos(displacement * kStep);
      turned_sine[k] = std::sin(displacement * kStep);
    }
    for (std::complex<double>& value : table_) {
      double whole = 0, rest_cosine = 0, rest_sine = 0;
      for (int k = 0; k < kMoments / 2; ++k) whole += cosine[k];
      for (int k = kMoments / 2; k < kAll; ++k) {
        rest_cosine += cosine[k];
        rest_sine += sine[k];
      }
      value = Mean(whole, {rest_cosine, -rest_sine});
      for (int k = 0; k < kAll; ++k) {
        const double next = cosine[k] * turned_cosine[k] - sine[k] * turned_sine[k];
        sine[k] = sine[k] * turned_cosine[k] + cosine[k] * turned_sine[k];
        cosine[k] = next;
      }
    }
  }

  // Product of the distances from every place to the others, in steps.
  static constexpr std::array<double, kPlaces> ProductsOfDistances() {
    std::array<double, kPlaces> products{};
    for (int j = 0; j < kPlaces; ++j) {
      products[j] = 1;
      for (int other = 0; other < kPlaces; ++other) {
        if (other != j) products[j] *= j - other;
      }
    }
    return products;
  }

  // A part `t` of a step beyond place `below`.
  std::complex<double> Interpolated(int below, double t) const {
    static constexpr std::array<double, kPlaces> kProducts = ProductsOfDistances();
    std::array<double, kPlaces> before, after;  // products of distances to the others
    double product = 1;
    for (int j = 0; j < kPlaces; ++j) {
      before[j] = product;
      product *= t - (j + kFirst);
    }
    product = 1;
    for (int j = kPlaces - 1; j >= 0; --j) {
      after[j] = product;
      product *= t - (j + kFirst);
    }
    std::complex<double> sum = 0;
    for (int j = 0; j < kPlaces; ++j) {
      sum += before[j] * after[j] / kProducts[j] * table_[below + j];
    }
    return sum;
  }

  double amplitude_m_;
  std::array<double, kMoments / 2> quarter_;  // of a quarter period: all magnitudes
  std::array<double, kMoments> remainder_;    // of what is left over whole periods
  double whole_share_ = 0;
  std::array<std::complex<double>, kTabulated + kPlaces> table_;  // from step kFirst on
};

}  // namespace

std::function<std::complex<double>(double, double)> SinusoidalMotionTransfer(double amplitude_m,
                                                                             double periods,
                                                                             double phase_rad) {
  const auto motion = std::make_shared<const Motion>(amplitude_m, periods, phase_rad);
  return [motion](double, double q_per_m) { return motion->Transfer(q_per_m); };
}

}  // namespace sightline
