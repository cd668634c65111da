#include "render_worker/diagnosis/line_spread.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <mutex>
#include <numbers>
#include <unsupported/Eigen/FFT>

namespace sightline {

namespace {

constexpr double kTwoPi = 2 * std::numbers::pi;

}  // namespace

namespace {

std::vector<std::complex<double>> ComputeLineTransfer(const Pupil& pupil, double wavelength_m,
                                                      double image_distance_m,
                                                      double defocus_curvature_per_m,
                                                      double step_per_m, int count) {
  const double radius_m = pupil.OuterRadius();
  // Fine enough that the phase turns by less than a radian or so between samples at the rim, and
  // that the line spread function's period, wavelength times f-number times samples, is long.
  const double defocus_waves =
      std::abs(defocus_curvature_per_m) * radius_m * radius_m / (2 * wavelength_m);
  const double spread_m = wavelength_m * image_distance_m / (2 * radius_m);
  constexpr double kPeriod_m = 1.2e-3;
  int samples = 64;
  while (samples < 1024 && (samples < 24 * defocus_waves || samples * spread_m < kPeriod_m)) {
    samples *= 2;
  }
  const int chords = std::min(samples, 128);
  const double step_m = 2 * radius_m / samples;
  Eigen::FFT<double> fft;
  std::vector<std::complex<double>> chord(2 * samples), spectrum;
  std::vector<double> power(2 * samples, 0);
  for (int c = 0; c < chords; ++c) {
    const double x = ((c + 0.5) / chords * 2 - 1) * radius_m;
    std::fill(chord.begin(), chord.end(), 0);
    for (int i = 0; i < samples; ++i) {
      const double y = (i + 0.5) * step_m - radius_m;
      const double transmission = pupil.Transmission(x, y);
      if (transmission == 0) continue;
      const double wavefront_m =
          pupil.WavefrontError(x, y) - 0.5 * defocus_curvature_per_m * (x * x + y * y);
      chord[i] = std::polar(transmission, kTwoPi / wavelength_m * wavefront_m);
    }
    fft.fwd(spectrum, chord);
    for (size_t k = 0; k < power.size(); ++k) power[k] += std::norm(spectrum[k]);
  }
  // `power` is the line spread function; zeros around it make its transform fine enough to be
  // interpolated.
  constexpr int kPadding = 8;
  const int half = samples;
  std::vector<std::complex<double>> padded(2 * samples * kPadding, 0), correlation;
  for (int k = 0; k < half; ++k) {
    padded[k] = power[k];
    padded[padded.size() - half + k] = power[half + k];
  }
  fft.inv(correlation, padded);
  // Frequency q shifts the pupil by lambda b q.
  std::vector<std::complex<double>> transfer(count, 0);
  for (int k = 0; k < count; ++k) {
    const double shift = wavelength_m * image_distance_m * k * step_per_m / step_m * kPadding;
    const int below = static_cast<int>(shift);
    if (below >= samples * kPadding) break;
    const double t = shift - below;
    transfer[k] =
        ((1 - t) * correlation[below] + t * correlation[below + 1]) / correlation[0].real();
  }
  return transfer;
}

}  // namespace

std::vector<std::complex<double>> LineTransfer(const Pupil& pupil, double wavelength_m,
                                               double image_distance_m,
                                               double defocus_curvature_per_m, double step_per_m,
                                               int count) {
  if (!pupil.IsFullCircle() || pupil.obstruction_radius_m != 0 || pupil.HasWavefrontError()) {
    return ComputeLineTransfer(pupil, wavelength_m, image_distance_m, defocus_curvature_per_m,
                               step_per_m, count);
  }
  // A plain lens is looked at again and again: most effects leave it as it is.
  using Key = std::array<double, 6>;
  constexpr size_t kMost = 1024;  // 16 kB each
  static std::mutex mutex;
  static auto* const known = new std::map<Key, std::vector<std::complex<double>>>;
  const Key key = {pupil.OuterRadius(),     wavelength_m, image_distance_m,
                   defocus_curvature_per_m, step_per_m,   static_cast<double>(count)};
  {
    const std::lock_guard<std::mutex> lock(mutex);
    const auto found = known->find(key);
    if (found != known->end()) return found->second;
  }
  std::vector<std::complex<double>> transfer = ComputeLineTransfer(
      pupil, wavelength_m, image_distance_m, defocus_curvature_per_m, step_per_m, count);
  const std::lock_guard<std::mutex> lock(mutex);
  if (known->size() >= kMost) known->clear();
  known->emplace(key, transfer);
  return transfer;
}

std::vector<double> BlurAcrossLine(const std::vector<double>& ideal, int samples_per_px,
                                   int margin_px, int rows_px, double pixel_pitch_m,
                                   const std::vector<std::complex<double>>& transfer) {
  const int n = static_cast<int>(ideal.size());
  Eigen::FFT<double> fft;
  std::vector<std::complex<double>> samples(ideal.begin(), ideal.end()), spectrum, blurred;
  fft.fwd(spectrum, samples);
  const double step_per_m = samples_per_px / (n * pixel_pitch_m);
  // Pixel centres lie half a sample before sample (i + margin) samples_per_px + samples_per_px/2.
  const double shift_m = 0.5 * (samples_per_px % 2 == 0 ? 1 : 0) * pixel_pitch_m / samples_per_px;
  for (int k = 0; k < n; ++k) {
    const int frequency = k <= n / 2 ? k : k - n;
    const double q = frequency * step_per_m;
    const int index = std::abs(frequency);
    std::complex<double> factor =
        index < static_cast<int>(transfer.size()) ? transfer[index] : std::complex<double>(0);
    if (frequency < 0) factor = std::conj(factor);
    const double x = std::numbers::pi * q * pixel_pitch_m;
    if (x != 0) factor *= std::sin(x) / x;
    spectrum[k] *= factor * std::polar(1.0, -kTwoPi * q * shift_m);
  }
  fft.inv(blurred, spectrum);
  std::vector<double> rows(rows_px);
  for (int i = 0; i < rows_px; ++i) {
    rows[i] = blurred[(i + margin_px) * samples_per_px + samples_per_px / 2].real();
  }
  return rows;
}

}  // namespace sightline
