// SPDX-License-Identifier: Apache-2.0
#include "render_worker/optics/optical_transfer.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "render_worker/optics/band_transform.h"
#include "render_worker/optics/complex_product.h"

namespace sightline {
namespace {

using std::numbers::pi;

bool IsClearCircle(const Pupil& pupil) {
  return pupil.IsFullCircle() && !pupil.HasWavefrontError();
}

// Overlap of two circles of diameter 1 shifted by s, over the circle's area (Goodman, Introduction
// to Fourier Optics, 4th ed., eq. 7-31).
double CircleOverlap(double s) {
  if (s >= 1) return 0;
  return 2 / pi * (std::acos(s) - s * std::sqrt(1 - s * s));
}

std::complex<double> GeneralisedPupil(const Pupil& pupil, double wavelength_m, double x, double y) {
  if (pupil.Transmission(x, y) == 0) return 0;
  return std::polar(1.0, 2 * pi / wavelength_m * pupil.WavefrontError(x, y));
}

}  // namespace

std::complex<double> OpticalTransfer(const Pupil& pupil, double wavelength_m,
                                     double image_distance_m, double qx_per_m, double qy_per_m) {
  const double shift_x = wavelength_m * image_distance_m * qx_per_m;
  const double shift_y = wavelength_m * image_distance_m * qy_per_m;
  if (IsClearCircle(pupil)) {
    return CircleOverlap(std::hypot(shift_x, shift_y) / (2 * pupil.radius_m));
  }
  constexpr int kPoints = 512;
  const double outer = pupil.OuterRadius();
  const double step = 2 * outer / kPoints;
  std::complex<double> correlation = 0;
  double area = 0;
  for (int i = 0; i < kPoints; ++i) {
    const double y = -outer + (i + 0.5) * step;
    for (int j = 0; j < kPoints; ++j) {
      const double x = -outer + (j + 0.5) * step;
      area += pupil.Transmission(x, y);
      const double x1 = x + shift_x / 2, y1 = y + shift_y / 2;
      const double x2 = x - shift_x / 2, y2 = y - shift_y / 2;
      if (pupil.Transmission(x1, y1) == 0 || pupil.Transmission(x2, y2) == 0) continue;
      correlation += GeneralisedPupil(pupil, wavelength_m, x1, y1) *
                     std::conj(GeneralisedPupil(pupil, wavelength_m, x2, y2));
    }
  }
  return area > 0 ? correlation / area : 0;
}

OpticalTransferTable::OpticalTransferTable(const Pupil& pupil, double wavelength_m,
                                           double image_distance_m)
    : scale_m2_(wavelength_m * image_distance_m),
      radius_m_(pupil.radius_m),
      outer_m_(pupil.OuterRadius()),
      clear_circle_(IsClearCircle(pupil)) {
  if (clear_circle_) return;
  // Autocorrelation by |FT|^2 on twice the pupil's width, so nothing wraps around.
  const int period = 2 * kSamples + 1;
  const double step = 2 * outer_m_ / kSamples;
  const BandTransform transform(period, period, kSamples, kSamples, 1);
  BandSpectrum spectrum = transform.Forward(AllRows(kSamples), [&](int row,
                                                                   std::complex<float>* samples) {
    for (int column = 0; column < kSamples; ++column) {
      samples[column] = std::complex<float>(GeneralisedPupil(
          pupil, wavelength_m, -outer_m_ + (column + 0.5) * step, -outer_m_ + (row + 0.5) * step));
    }
  });
  for (std::complex<float>& value : spectrum.values) value = SquaredModulus(value);
  table_ = Image<std::complex<float>>(period, period);
  transform.Backward(spectrum, [&](int row, std::complex<float>* samples) {
    for (int column = 0; column < period; ++column) {
      table_.At((row + kSamples) % period, (column + kSamples) % period) = samples[column];
    }
  });
  const float peak = table_.At(kSamples, kSamples).real();
  if (peak > 0) {
    for (std::complex<float>& value : table_.values) value /= peak;
  }
}

std::complex<float> OpticalTransferTable::At(double qx_per_m, double qy_per_m) const {
  if (clear_circle_) {
    return static_cast<float>(
        CircleOverlap(scale_m2_ * std::hypot(qx_per_m, qy_per_m) / (2 * radius_m_)));
  }
  const double step = 2 * outer_m_ / kSamples;
  const double x = scale_m2_ * qx_per_m / step + kSamples;
  const double y = scale_m2_ * qy_per_m / step + kSamples;
  const int column = static_cast<int>(std::floor(x));
  const int row = static_cast<int>(std::floor(y));
  if (column < 0 || row < 0 || column >= 2 * kSamples || row >= 2 * kSamples) return 0;
  const float a = static_cast<float>(x - column);
  const float b = static_cast<float>(y - row);
  return (table_.At(row, column) * (1 - a) + table_.At(row, column + 1) * a) * (1 - b) +
         (table_.At(row + 1, column) * (1 - a) + table_.At(row + 1, column + 1) * a) * b;
}

}  // namespace sightline
