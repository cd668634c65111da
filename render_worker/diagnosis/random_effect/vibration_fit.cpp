// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/random_effect/vibration_fit.h"

#include <algorithm>
#include <array>
#include <boost/math/special_functions/sinc.hpp>
#include <cassert>
#include <cmath>
#include <numbers>

#include "core/statistics/square.h"

namespace sightline {

namespace {

using boost::math::sinc_pi;
using std::numbers::pi;
constexpr double kOutliers = 1e-3;  // fraction of the recordings
// Standard errors that moments have because they neglect a profile's skew and are computed from a
// clipped and noisy one.
constexpr double kShiftError_px = 0.05, kBlurError_px2 = 0.03, kBlurErrorRelative = 0.05;

// Squared distance from which on exp(-distance / 2) is 0 in double precision (below e^-745.2), as
// in most of the grid. exp() is slowest there.
constexpr double kVanishes = 1500;

// Evenly spaced phases, which have sin(phase) from one end to the other.
struct PhaseGrid {
  static constexpr int kCount = 96;
  std::array<double, kCount> sine, square;
  PhaseGrid() {
    for (int k = 0; k < kCount; ++k) {
      sine[k] = std::sin(pi * ((k + 0.5) / kCount - 0.5));
      square[k] = Square(sine[k]);
    }
  }
};

// A grid in the logarithms of amplitude and frequency.
struct Axis {
  double lowest, highest;  // logarithms
  int points;
  double At(int i) const {
    return std::exp(lowest + (highest - lowest) * i / std::max(1, points - 1));
  }
  double Step() const { return (highest - lowest) / std::max(1, points - 1); }
};

}  // namespace

double BlurByVibration(double amplitude_px, double frequency_hz, double exposure_time_s,
                       double mean_px) {
  const double half_turn = pi * frequency_hz * exposure_time_s;
  const double farthest = Square(amplitude_px * sinc_pi(half_turn));
  const double square = farthest > 0 ? std::min(1.0, mean_px * mean_px / farthest) : 0;
  return 0.5 * amplitude_px * amplitude_px * (1 - sinc_pi(2 * half_turn) * (1 - 2 * square)) -
         farthest * square;
}

double VibrationLogLikelihood(std::span<const RecordedMovement> movements, double amplitude_px,
                              double frequency_hz) {
  static const PhaseGrid phases;
  const auto farthest_of = [&](const RecordedMovement& seen) {
    return amplitude_px * std::abs(sinc_pi(pi * frequency_hz * seen.exposure_time_s));
  };
  const auto shift_error_of = [](const RecordedMovement& seen) {
    return std::hypot(seen.shift_error_px, kShiftError_px);
  };
  // The common place that is nearest to all displacements, given their variances.
  double weights = 0, place_px = 0;
  for (const RecordedMovement& seen : movements) {
    const double weight = 1 / (Square(shift_error_of(seen)) + 0.5 * Square(farthest_of(seen)));
    weights += weight;
    place_px += weight * seen.shift_px;
  }
  place_px /= weights;
  double sum = 0;
  for (const RecordedMovement& seen : movements) {
    const double half_turn = pi * frequency_hz * seen.exposure_time_s;
    const double farthest_px = farthest_of(seen);
    const double half_square = 0.5 * amplitude_px * amplitude_px;
    const double swing = sinc_pi(2 * half_turn);
    const double shift_error = shift_error_of(seen);
    const double blur_error = std::hypot(seen.blur_error_px2, kBlurError_px2,
                                         kBlurErrorRelative * std::max(0.0, seen.blur_px2));
    double likelihood = 0;
    for (int k = 0; k < PhaseGrid::kCount; ++k) {
      const double blur = half_square * (1 - swing * (1 - 2 * phases.square[k])) -
                          farthest_px * farthest_px * phases.square[k];
      const double shift = place_px + farthest_px * phases.sine[k];
      const double distance = Square((seen.shift_px - shift) / shift_error) +
                              Square((seen.blur_px2 - blur) / blur_error);
      if (!(distance > kVanishes)) likelihood += std::exp(-0.5 * distance);
    }
    sum += std::log(likelihood / PhaseGrid::kCount + kOutliers);
  }
  return sum;
}

VibrationFit FitVibration(std::span<const RecordedMovement> movements) {
  assert(!movements.empty());
  Axis amplitudes{std::log(0.02), std::log(50), 60};
  Axis frequencies{std::log(1), std::log(5e3), 240};
  double best_amplitude = 0, best_frequency = 0, best = -1e300;
  const auto evaluate = [&] {
    for (int i = 0; i < amplitudes.points; ++i) {
      for (int j = 0; j < frequencies.points; ++j) {
        const double a = amplitudes.At(i), f = frequencies.At(j);
        const double likelihood = VibrationLogLikelihood(movements, a, f);
        if (likelihood <= best) continue;
        best = likelihood;
        best_amplitude = a;
        best_frequency = f;
      }
    }
  };
  evaluate();
  for (int turn = 0; turn < 2; ++turn) {
    const double amplitude_step = 2 * amplitudes.Step(), frequency_step = 2 * frequencies.Step();
    amplitudes = {std::log(best_amplitude) - amplitude_step,
                  std::log(best_amplitude) + amplitude_step, 25};
    frequencies = {std::log(best_frequency) - frequency_step,
                   std::log(best_frequency) + frequency_step, 25};
    evaluate();
  }
  // Half width at which the likelihood, maximised over the other parameter, falls by half a nat.
  const auto half_width = [&](double at, double step, const auto& profile) {
    double width = step;
    for (int k = 1; k <= 400; ++k) {
      width = k * step;
      if (std::max(profile(at * std::exp(width)), profile(at * std::exp(-width))) < best - 0.5) {
        break;
      }
    }
    return at * width;
  };
  const auto best_over = [](double at, double step, const auto& likelihood) {
    double largest = -1e300;
    for (int k = -8; k <= 8; ++k) largest = std::max(largest, likelihood(at * std::exp(k * step)));
    return largest;
  };
  constexpr double kStep = 0.005;
  VibrationFit fit;
  fit.amplitude_px = best_amplitude;
  fit.frequency_hz = best_frequency;
  fit.amplitude_error_px = half_width(best_amplitude, kStep, [&](double a) {
    return best_over(best_frequency, kStep,
                     [&](double f) { return VibrationLogLikelihood(movements, a, f); });
  });
  fit.frequency_error_hz = half_width(best_frequency, kStep, [&](double f) {
    return best_over(best_amplitude, kStep,
                     [&](double a) { return VibrationLogLikelihood(movements, a, f); });
  });
  return fit;
}

bool IsSeenInSingleRecordings(std::span<const RecordedMovement> movements) {
  constexpr int kLeastRecordings = 5;
  constexpr double kStandsOut = 5;
  return std::count_if(movements.begin(), movements.end(), [](const RecordedMovement& seen) {
           return seen.blur_px2 > kStandsOut * std::hypot(seen.blur_error_px2, kBlurError_px2);
         }) >= kLeastRecordings;
}

}  // namespace sightline
