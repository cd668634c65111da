// SPDX-License-Identifier: Apache-2.0
// The image of coherent light as a direct sum: every scatterer's wave through every sample of the
// pupil to every point of the pixels, in double precision and without any fast transform.
#pragma once

#include <array>
#include <cmath>
#include <complex>
#include <map>
#include <numbers>
#include <vector>

#include "render_worker/optics/image_optics.h"

namespace sightline::optics_test {

// Nodes and weights of Gauss-Legendre quadrature with 8 points on [-1/2, 1/2].
inline constexpr std::array<double, 4> kNodes = {0.0917173212478249, 0.2627662049581645,
                                                 0.3983332387068134, 0.4801449282487682};
inline constexpr std::array<double, 4> kWeights = {0.1813418916891810, 0.1568533229389436,
                                                   0.1111905172266872, 0.0506142681451881};

struct Wave {
  double u_m, v_m;
  std::complex<double> amplitude;
  double curvature;
};

// Mean of |U|^2 over the pixel at (u, v); U(x) = sum over scatterers and pupil samples r of
// a exp(i k W(r)) exp(i 2 pi r (x - x_s) / (lambda b)), scaled to unit mean square transfer.
class DirectSum {
 public:
  // Pupil samples stand for a period of the plane; samples: of a transform over it.
  DirectSum(const std::vector<Wave>& waves, const OpticsModel& optics, double period_u_m,
            double period_v_m, double samples)
      : scale_u_(1 / period_u_m), scale_v_(1 / period_v_m) {
    const Pupil pupil = optics.pupil(0, 0);
    const double wavelength_m = optics.wavelength_m;
    const double step_u = wavelength_m * optics.image_distance_m * scale_u_;
    const double step_v = wavelength_m * optics.image_distance_m * scale_v_;
    half_u_ = static_cast<int>(pupil.OuterRadius() / step_u) + 1;
    half_v_ = static_cast<int>(pupil.OuterRadius() / step_v) + 1;
    spectrum_.resize(static_cast<size_t>(2 * half_u_ + 1) * (2 * half_v_ + 1));
    // Waves of one depth share the phase they get in the pupil.
    std::map<double, std::vector<const Wave*>> by_curvature;
    for (const Wave& wave : waves) by_curvature[wave.curvature].push_back(&wave);
    double passing = 0;
    for (const auto& [curvature, group] : by_curvature) {
      std::vector<std::vector<std::complex<double>>> along, down;
      for (const Wave* wave : group) {
        along.push_back(Phases(-wave->u_m * scale_u_, half_u_));
        down.push_back(Phases(-wave->v_m * scale_v_, half_v_));
      }
      passing = 0;
      for (int l = -half_v_; l <= half_v_; ++l) {
        for (int k = -half_u_; k <= half_u_; ++k) {
          const double x = k * step_u, y = l * step_v;
          if (pupil.Transmission(x, y) == 0) continue;
          passing += 1;
          std::complex<double> sum = 0;
          for (size_t i = 0; i < group.size(); ++i) {
            sum += group[i]->amplitude * along[i][k + half_u_] * down[i][l + half_v_];
          }
          const double w = pupil.WavefrontError(x, y) - 0.5 * curvature * (x * x + y * y);
          At(k, l) += sum * std::polar(1.0, 2 * std::numbers::pi / wavelength_m * w);
        }
      }
    }
    for (std::complex<double>& value : spectrum_) value *= std::sqrt(samples / passing) / samples;
  }

  double PixelMean(double u_m, double v_m, double pitch_m) {
    double mean = 0;
    for (int i = -4; i < 4; ++i) {
      for (int j = -4; j < 4; ++j) {
        const auto node = [](int n) { return n < 0 ? -kNodes[-n - 1] : kNodes[n]; };
        const auto weight = [](int n) { return n < 0 ? kWeights[-n - 1] : kWeights[n]; };
        mean += weight(i) * weight(j) *
                std::norm(Field(u_m + node(j) * pitch_m, v_m + node(i) * pitch_m));
      }
    }
    return mean;
  }

 private:
  static std::vector<std::complex<double>> Phases(double cycles, int half) {
    std::vector<std::complex<double>> phases;
    for (int k = -half; k <= half; ++k)
      phases.push_back(std::polar(1.0, 2 * std::numbers::pi * k * cycles));
    return phases;
  }
  std::complex<double>& At(int k, int l) {
    return spectrum_[static_cast<size_t>(l + half_v_) * (2 * half_u_ + 1) + k + half_u_];
  }
  std::complex<double> Field(double u_m, double v_m) {
    const std::vector<std::complex<double>> along = Phases(u_m * scale_u_, half_u_);
    const std::vector<std::complex<double>> down = Phases(v_m * scale_v_, half_v_);
    std::complex<double> sum = 0;
    for (int l = -half_v_; l <= half_v_; ++l) {
      std::complex<double> row = 0;
      for (int k = -half_u_; k <= half_u_; ++k) row += At(k, l) * along[k + half_u_];
      sum += row * down[l + half_v_];
    }
    return sum;
  }

  double scale_u_, scale_v_;
  int half_u_ = 0, half_v_ = 0;
  std::vector<std::complex<double>> spectrum_;
};

}  // namespace sightline::optics_test
