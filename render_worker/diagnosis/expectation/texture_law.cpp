// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/expectation/texture_law.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <cstdlib>
#include <numbers>

#include "render_worker/plate/plate_scene.h"

namespace sightline {

namespace {

// Fraction of the variance that is left after averaging over the width of the line.
double LeftByWidth(const FrameSetup& frame, double correlation_m) {
  const double deviation_m = BeamRadius(frame.laser, frame.plate.laser_distance_m) /
                             (2 * std::cos(frame.plate.incidence_angle_rad));
  return 1 / std::sqrt(1 + 4 * std::pow(deviation_m / correlation_m, 2));
}

}  // namespace

double LengthOnPlate(const FrameSetup& frame, int columns_px) {
  const double magnification = frame.ImageDistance() / frame.plate.camera_distance_m;
  return columns_px * frame.sensor.pixel_pitch_m / magnification;
}

bool IsTexture(RandomLaw law) {
  return law == RandomLaw::kGaussianReflectance || law == RandomLaw::kExponentialReflectance;
}

TextureLaw::TextureLaw(RandomLaw law, const FrameSetup& frame,
                       const std::vector<double>& parameters)
    : gaussian_(law == RandomLaw::kGaussianReflectance),
      variance_(parameters[0] * parameters[0]),
      correlation_m_(parameters[1]) {
  assert(IsTexture(law));
  if (gaussian_) variance_ *= LeftByWidth(frame, correlation_m_);
}

double TextureLaw::CorrelationIntegratedTwice(double distance_m) const {
  const double t = std::abs(distance_m) / correlation_m_;
  const double square = correlation_m_ * correlation_m_;
  if (!gaussian_) return square * (t + std::exp(-t));
  return 0.5 * square * (std::sqrt(std::numbers::pi) * t * std::erf(t) + std::exp(-t * t));
}

double TextureLaw::Covariance(double length_m, double distance_m) const {
  return variance_ *
         (CorrelationIntegratedTwice(distance_m + length_m) -
          2 * CorrelationIntegratedTwice(distance_m) +
          CorrelationIntegratedTwice(distance_m - length_m)) /
         (length_m * length_m);
}

double TextureLaw::VarianceAlong(double length_m) const {
  return variance_ - Covariance(length_m, 0);
}

double TextureLaw::DeviationOfVarianceAlong(double length_m) const {
  constexpr int kParts = 24;
  std::array<double, kParts> covariance;  // of parts at this distance, in parts
  for (int apart = 0; apart < kParts; ++apart) {
    covariance[apart] = Covariance(length_m / kParts, apart * length_m / kParts);
  }
  // Squared norm of C about its means: |C|^2 - 2 |C 1|^2/n + (1'C1)^2/n^2.
  double square = 0, square_of_rows = 0, sum = 0;
  for (int i = 0; i < kParts; ++i) {
    double row = 0;
    for (int j = 0; j < kParts; ++j) {
      const double c = covariance[std::abs(i - j)];
      row += c;
      square += c * c;
    }
    square_of_rows += row * row;
    sum += row;
  }
  const double about_mean = square - 2 * square_of_rows / kParts + sum * sum / (kParts * kParts);
  return std::sqrt(2 * std::max(0.0, about_mean)) / kParts;
}

}  // namespace sightline
