// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/expectation/line_spread.h"

#include <algorithm>
#include <array>
#include <boost/math/special_functions/legendre.hpp>
#include <cassert>
#include <cmath>
#include <numbers>
#include <numeric>
#include <tuple>
#include <utility>

#include "core/memo/memo.h"
#include "render_worker/optics/complex_product.h"
#include "render_worker/optics/fourier.h"

namespace sightline {

namespace {

constexpr double kTwoPi = 2 * std::numbers::pi;

// A circle without aberrations, defocus apart.
bool IsPlain(const Pupil& pupil) {
  return pupil.IsFullCircle() && pupil.obstruction_radius_m == 0 && !pupil.HasWavefrontError();
}

// Wavefront error along the chord at x: a low polynomial, so parabolas through some places do.
class ChordWavefront {
 public:
  ChordWavefront(const Pupil& pupil, double radius_m, double x) : radius_m_(radius_m) {
    for (int i = 0; i <= kSteps; ++i) {
      places_[i] = pupil.WavefrontError(x, radius_m * (2.0 * i / kSteps - 1));
    }
  }
  double At(double y) const {
    const double place = 0.5 * (y / radius_m_ + 1) * kSteps;
    const int middle = std::clamp(static_cast<int>(std::lround(place)), 1, kSteps - 1);
    const double t = place - middle;
    const double before = places_[middle - 1], here = places_[middle], after = places_[middle + 1];
    return here + 0.5 * t * (after - before) + 0.5 * t * t * (after - 2 * here + before);
  }

 private:
  static constexpr int kSteps = 64;
  double radius_m_;
  std::array<double, kSteps + 1> places_{};
};

// First and past the last of `count` samples of a chord that are inside; of a convex shape by
// bisection, else all.
template <typename Inside>
std::pair<int, int> InsideOf(int count, bool convex, const Inside& inside) {
  if (!convex) return {0, count};
  int known = -1;
  for (int parts = 2; parts <= count && known < 0; parts *= 2) {
    for (int i = count / parts; i < count && known < 0; i += 2 * (count / parts)) {
      if (inside(i)) known = i;
    }
  }
  if (known < 0) return {0, 0};
  int outside = -1, first = known;
  while (first - outside > 1) {
    const int middle = (first + outside) / 2;
    (inside(middle) ? first : outside) = middle;
  }
  int last = known, beyond = count;
  while (beyond - last > 1) {
    const int middle = (last + beyond) / 2;
    (inside(middle) ? last : beyond) = middle;
  }
  return {first, beyond};
}

// Nodes and weights of the Gauss-Legendre quadrature over [0, 1].
struct Quadrature {
  std::vector<double> places, weights;
};

Quadrature GaussLegendre(int count) {
  Quadrature quadrature;
  const auto add = [&](double zero) {
    const double slope = boost::math::legendre_p_prime(count, zero);
    quadrature.places.push_back(0.5 * (1 + zero));
    quadrature.weights.push_back(1 / ((1 - zero * zero) * slope * slope));
  };
  for (const double zero : boost::math::legendre_p_zeros<double>(count)) {
    add(zero);
    if (zero > 0) add(-zero);
  }
  return quadrature;
}

// The smallest known one with at least `count` places.
const Quadrature& QuadratureOf(int count) {
  constexpr std::array<int, 11> kCounts = {12, 16, 24, 32, 48, 64, 96, 128, 192, 256, 384};
  static const std::array<Quadrature, kCounts.size()> known = [&] {
    std::array<Quadrature, kCounts.size()> all;
    for (size_t i = 0; i < all.size(); ++i) all[i] = GaussLegendre(kCounts[i]);
    return all;
  }();
  const auto enough = std::find_if(kCounts.begin(), kCounts.end(),
                                   [&](int known_count) { return known_count >= count; });
  return enough == kCounts.end() ? known.back() : known[enough - kCounts.begin()];
}

// Hopkins (Proc. R. Soc. A 231 (1955) 91): two circles of unit radius, 2 s apart, have in common
// (4/pi) int_s^1 sqrt(1 - u^2) cos(2 pi 4 W s (u - s)) du, W waves of defocus at the rim; with u =
// 1 - (1 - s) v^2 the integrand is smooth.
std::vector<std::complex<double>> TransferOfCircle(double defocus_waves, double shift_per_step,
                                                   int count) {
  std::vector<std::complex<double>> transfer(count, 0);
  for (int k = 0; k < count && k * shift_per_step < 1; ++k) {
    const double s = k * shift_per_step, left = 1 - s;
    const double turns = 4 * defocus_waves * s * left;
    const Quadrature& quadrature = QuadratureOf(12 + static_cast<int>(3.5 * std::abs(turns)));
    double sum = 0;
    for (size_t i = 0; i < quadrature.places.size(); ++i) {
      const double v = quadrature.places[i], square = v * v;
      sum += quadrature.weights[i] * square * std::sqrt(2 - left * square) *
             PhasorOfTurns(turns * (1 - square)).real();
    }
    transfer[k] = 8 / std::numbers::pi * left * std::sqrt(left) * sum;
  }
  return transfer;
}

double RimWaves(const Pupil& pupil, double wavelength_m, double defocus_curvature_per_m) {
  const double radius_m = pupil.OuterRadius();
  return 0.5 * std::abs(defocus_curvature_per_m) * radius_m * radius_m / wavelength_m;
}

// By samples of the pupil, of which the line spread function is periodic in at least `period_m`.
std::vector<std::complex<double>> SampledTransfer(const Pupil& pupil, double wavelength_m,
                                                  double image_distance_m,
                                                  double defocus_curvature_per_m, double step_per_m,
                                                  int count, double period_m) {
  const double radius_m = pupil.OuterRadius();
  // Fine enough that the phase turns by less than a radian or so between samples at the rim, and
  // that the line spread function's period, wavelength times f-number times samples, is long.
  const double rim_waves = RimWaves(pupil, wavelength_m, defocus_curvature_per_m);
  const double spread_m = wavelength_m * image_distance_m / (2 * radius_m);
  int samples = 64;
  while (samples < 4096 && (samples < 24 * rim_waves || samples * spread_m < period_m)) {
    samples *= 2;
  }
  const int chords = std::min(samples, 128);
  const double step_m = 2 * radius_m / samples;
  const auto defocus_at = [&](double y) { return -0.5 * defocus_curvature_per_m * y * y; };
  // Defocus of the place along a chord; that of the chord's own place turns all of it alike.
  std::vector<std::complex<float>> phasors(samples);
  for (int i = 0; i < samples; ++i) {
    phasors[i] = PhasorOfTurns(defocus_at((i + 0.5) * step_m - radius_m) / wavelength_m);
  }
  const bool circle = pupil.IsFullCircle();
  const bool convex = pupil.obstruction_radius_m <= 0;
  const bool aberrated = pupil.HasWavefrontError();
  std::vector<double> turns(aberrated ? samples : 0);
  const FourierPlan along(FourierPlan::Direction::kForward, 2 * samples);
  FourierBuffer<std::complex<float>> chord(FourierStride(2 * samples));
  std::vector<double> power(2 * static_cast<size_t>(samples), 0);
  // Both halves of a plain pupil are alike.
  for (int c = IsPlain(pupil) ? chords / 2 : 0; c < chords; ++c) {
    const double x = ((c + 0.5) / chords * 2 - 1) * radius_m;
    chord.Clear();
    if (aberrated) {
      const ChordWavefront wavefront(pupil, radius_m, x);
      for (int i = 0; i < samples; ++i) {
        const double y = (i + 0.5) * step_m - radius_m;
        turns[i] = (wavefront.At(y) + defocus_at(y)) / wavelength_m;
      }
      for (int i = 0; i < samples; ++i) phasors[i] = PhasorOfTurns(turns[i]);
    }
    const auto inside = [&](int i) {
      const double y = (i + 0.5) * step_m - radius_m;
      return circle ? x * x + y * y <= radius_m * radius_m : pupil.Transmission(x, y) > 0;
    };
    const auto [first, last] = InsideOf(samples, convex, inside);
    for (int i = first; i < last; ++i) {
      if (convex || inside(i)) chord[i] = phasors[i];
    }
    along.Run(chord.data());
    for (size_t k = 0; k < power.size(); ++k) power[k] += std::norm(chord[k]);
  }
  // `power` is the line spread function; zeros around it make its transform fine enough to be
  // interpolated.
  const int padding = std::max(1, 8192 / samples);
  const int padded = 2 * samples * padding;
  FourierBuffer<float> spread(FourierStride(padded));
  FourierBuffer<std::complex<float>> correlation(FourierStride(padded / 2 + 1));
  const double total = std::accumulate(power.begin(), power.end(), 0.0);
  for (int k = 0; k < samples; ++k) {
    spread[k] = static_cast<float>(power[k] / total);
    spread[padded - samples + k] = static_cast<float>(power[samples + k] / total);
  }
  RealFourierPlan(padded).Run(spread.data(), correlation.data());
  // Frequency q shifts the pupil by lambda b q.
  std::vector<std::complex<double>> transfer(count, 0);
  for (int k = 0; k < count; ++k) {
    const double shift = wavelength_m * image_distance_m * k * step_per_m / step_m * padding;
    const int below = static_cast<int>(shift);
    if (below >= samples * padding) break;
    const double t = shift - below;
    // Sign opposite to that of the transform.
    const std::complex<double> here(correlation[below]), next(correlation[below + 1]);
    transfer[k] = std::conj((1 - t) * here + t * next);
  }
  return transfer;
}

std::vector<std::complex<double>> ComputeLineTransfer(const Pupil& pupil, double wavelength_m,
                                                      double image_distance_m,
                                                      double defocus_curvature_per_m,
                                                      double step_per_m, int count) {
  constexpr double kPeriod_m = 3.6e-3, kShortPeriod_m = 0.9e-3;
  constexpr double kMostWaves = 100;  // that the quadrature is fine enough for
  const auto sampled = [&](const Pupil& of, double period_m) {
    return SampledTransfer(of, wavelength_m, image_distance_m, defocus_curvature_per_m, step_per_m,
                           count, period_m);
  };
  const double rim_waves = RimWaves(pupil, wavelength_m, defocus_curvature_per_m);
  if (rim_waves > kMostWaves || pupil.blades > 0 || pupil.obstruction_radius_m > 0) {
    return sampled(pupil, kPeriod_m);
  }
  const double shift_per_step = wavelength_m * image_distance_m * step_per_m / (2 * pupil.radius_m);
  std::vector<std::complex<double>> transfer = TransferOfCircle(rim_waves, shift_per_step, count);
  if (IsPlain(pupil)) return transfer;
  // Far from the line hard edges alone count: what aberrations change is near.
  Pupil circle;
  circle.radius_m = pupil.radius_m;
  const std::vector<std::complex<double>> shaped = sampled(pupil, kShortPeriod_m);
  const std::vector<std::complex<double>> round = sampled(circle, kShortPeriod_m);
  for (int k = 0; k < count; ++k) transfer[k] += shaped[k] - round[k];
  return transfer;
}

}  // namespace

std::vector<std::complex<double>> LineTransfer(const Pupil& pupil, double wavelength_m,
                                               double image_distance_m,
                                               double defocus_curvature_per_m, double step_per_m,
                                               int count) {
  // The same lens recurs often, since most effects leave it unchanged.
  using Key = std::tuple<Pupil, double, double, double, double, int>;
  constexpr size_t kMost = 4096;  // 16 kB each
  static auto* const known = new Memo<Key, std::vector<std::complex<double>>>(kMost);
  return known->Get(
      {pupil, wavelength_m, image_distance_m, defocus_curvature_per_m, step_per_m, count}, [&] {
        return ComputeLineTransfer(pupil, wavelength_m, image_distance_m, defocus_curvature_per_m,
                                   step_per_m, count);
      });
}

std::vector<std::complex<double>> PixelTransfer(int samples_per_px, int length,
                                                double pixel_pitch_m) {
  using Key = std::tuple<int, int, double>;
  static auto* const known = new Memo<Key, std::vector<std::complex<double>>>(16);
  return known->Get({samples_per_px, length, pixel_pitch_m}, [&] {
    const double step_per_m = samples_per_px / (length * pixel_pitch_m);
    // A pixel's centre lies half a sample before sample samples_per_px / 2 of its own.
    const double centre_m = (0.5 * samples_per_px - 0.5) * pixel_pitch_m / samples_per_px;
    std::vector<std::complex<double>> transfer(length / 2 + 1);
    for (int k = 0; k <= length / 2; ++k) {
      const double q = k * step_per_m;
      const double x = std::numbers::pi * q * pixel_pitch_m;
      transfer[k] = std::polar(x == 0 ? 1 : std::sin(x) / x, kTwoPi * q * centre_m);
    }
    return transfer;
  });
}

std::vector<double> BlurAcrossLine(const std::vector<double>& ideal, int samples_per_px,
                                   int margin_px, int rows_px,
                                   const std::vector<std::complex<double>>& transfer) {
  const int n = static_cast<int>(ideal.size());
  const int pixels = n / samples_per_px;
  assert(static_cast<int>(transfer.size()) == n / 2 + 1 && pixels * samples_per_px == n);
  FourierBuffer<float> samples(FourierStride(n));
  FourierBuffer<std::complex<float>> spectrum(FourierStride(n / 2 + 1));
  std::copy(ideal.begin(), ideal.end(), samples.data());
  RealFourierPlan(n).Run(samples.data(), spectrum.data());
  for (int k = 0; k <= n / 2; ++k) {
    spectrum[k] = Product(spectrum[k], std::complex<float>(transfer[k]));
  }
  // One sample a pixel is wanted: frequencies that are alike there add up.
  FourierBuffer<std::complex<float>> folded(FourierStride(pixels / 2 + 1));
  for (int k = 0; k < n; ++k) {
    const int alias = k % pixels;
    if (alias > pixels / 2) continue;
    folded[alias] += k <= n / 2 ? spectrum[k] : std::conj(spectrum[n - k]);
  }
  FourierBuffer<float> blurred(FourierStride(pixels));
  RealBackwardFourierPlan(pixels).Run(folded.data(), blurred.data());
  std::vector<double> rows(rows_px);
  for (int i = 0; i < rows_px; ++i) rows[i] = blurred[i + margin_px] / n;
  return rows;
}

}  // namespace sightline
