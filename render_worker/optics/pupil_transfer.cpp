// SPDX-License-Identifier: Apache-2.0
#include "render_worker/optics/pupil_transfer.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <optional>

#include "render_worker/optics/parallel_rows.h"

namespace sightline {
namespace {

using std::numbers::pi;

int HalfWidth(double cut_off_per_m, int length, double pitch_m) {
  return static_cast<int>(std::floor(cut_off_per_m * length * pitch_m));
}

// The wavefront error by cubic interpolation in a table: it is a polynomial of low order, and the
// pupil has millions of samples.
class WavefrontTable {
 public:
  WavefrontTable(const Pupil& pupil, int threads)
      : step_(2 * pupil.OuterRadius() / (kNodes - 5)), first_(-pupil.OuterRadius() - 2 * step_) {
    ForIndexRanges(threads, kNodes, [&](int begin, int end) {
      for (int i = begin; i < end; ++i) {
        for (int j = 0; j < kNodes; ++j) {
          values_.At(i, j) = pupil.WavefrontError(first_ + j * step_, first_ + i * step_);
        }
      }
    });
  }

  // The table's column of y at one x.
  std::vector<double> Column(double x_m) const {
    const Weights at = WeightsOf(x_m);
    std::vector<double> column(kNodes);
    for (int i = 0; i < kNodes; ++i) {
      for (int n = 0; n < 4; ++n) column[i] += at.weight[n] * values_.At(i, at.first + n);
    }
    return column;
  }
  double At(const std::vector<double>& column, double y_m) const {
    const Weights at = WeightsOf(y_m);
    double value = 0;
    for (int n = 0; n < 4; ++n) value += at.weight[n] * column[at.first + n];
    return value;
  }

 private:
  static constexpr int kNodes = 192;
  struct Weights {
    int first;
    double weight[4];
  };
  // Lagrange's through four nodes.
  Weights WeightsOf(double place_m) const {
    const double place = (place_m - first_) / step_;
    const int first = std::clamp(static_cast<int>(place) - 1, 0, kNodes - 4);
    const double t = place - first;
    return {first,
            {-(t - 1) * (t - 2) * (t - 3) / 6, t * (t - 2) * (t - 3) / 2,
             -t * (t - 1) * (t - 3) / 2, t * (t - 1) * (t - 2) / 6}};
  }

  double step_, first_;
  Image<double> values_{kNodes, kNodes};
};

std::complex<float> UnitPhasor(double phase_rad) {
  return {static_cast<float>(std::cos(phase_rad)), static_cast<float>(std::sin(phase_rad))};
}

std::vector<std::complex<float>> AxisPhase(int half, double frequency_step_per_m, int length,
                                           double wavelength_m, double image_distance_m,
                                           double curvature_per_m, double shift_samples) {
  std::vector<std::complex<float>> phases;
  for (int k = -half; k <= half; ++k) {
    const double r = wavelength_m * image_distance_m * k * frequency_step_per_m;
    phases.push_back(UnitPhasor(-pi / wavelength_m * curvature_per_m * r * r -
                                2 * pi * k * shift_samples / length));
  }
  return phases;
}

}  // namespace

int TransferGrid::HalfColumns(const Pupil& pupil) const {
  return HalfWidth(CutOffFrequency(pupil, wavelength_m, image_distance_m), columns, sample_pitch_m);
}

int TransferGrid::HalfRows(const Pupil& pupil) const {
  return HalfWidth(CutOffFrequency(pupil, wavelength_m, image_distance_m), rows, sample_pitch_m);
}

BandSpectrum PupilTransfer(const Pupil& pupil, const TransferGrid& grid, int threads) {
  BandSpectrum transfer(std::min(grid.HalfColumns(pupil), (grid.columns - 1) / 2),
                        std::min(grid.HalfRows(pupil), (grid.rows - 1) / 2));
  const double scale = grid.wavelength_m * grid.image_distance_m;
  std::optional<WavefrontTable> wavefront;
  if (pupil.HasWavefrontError()) wavefront.emplace(pupil, threads);
  std::vector<int64_t> passing(static_cast<size_t>(transfer.width()));
  ForIndexRanges(threads, transfer.width(), [&](int begin, int end) {
    for (int c = begin; c < end; ++c) {
      const int k = c - transfer.half_columns;
      std::complex<float>* column = transfer.Column(k);
      const double x = scale * grid.FrequencyU(k);
      const std::vector<double> errors = wavefront ? wavefront->Column(x) : std::vector<double>();
      for (int l = -transfer.half_rows; l <= transfer.half_rows; ++l) {
        const double y = scale * grid.FrequencyV(l);
        if (pupil.Transmission(x, y) == 0) continue;
        ++passing[c];
        column[l] = wavefront ? UnitPhasor(2 * pi / grid.wavelength_m * wavefront->At(errors, y))
                              : std::complex<float>(1);
      }
    }
  });
  int64_t total = 0;
  for (const int64_t count : passing) total += count;
  if (total == 0) return transfer;
  const float c = static_cast<float>(
      std::sqrt(static_cast<double>(grid.columns) * grid.rows / static_cast<double>(total)));
  for (std::complex<float>& value : transfer.values) value *= c;
  return transfer;
}

SeparablePhase DefocusAndShift(const TransferGrid& grid, int half_columns, int half_rows,
                               double curvature_per_m, double shift_columns, double shift_rows) {
  return {AxisPhase(half_columns, grid.FrequencyU(1), grid.columns, grid.wavelength_m,
                    grid.image_distance_m, curvature_per_m, shift_columns),
          AxisPhase(half_rows, grid.FrequencyV(1), grid.rows, grid.wavelength_m,
                    grid.image_distance_m, curvature_per_m, shift_rows)};
}

Image<std::complex<float>> AmplitudeTransfer(const Pupil& pupil, double wavelength_m,
                                             double image_distance_m,
                                             double defocus_curvature_per_m, int columns, int rows,
                                             double sample_pitch_m) {
  const TransferGrid grid = {wavelength_m, image_distance_m, sample_pitch_m, columns, rows};
  const BandSpectrum transfer = PupilTransfer(pupil, grid, 1);
  const SeparablePhase phase = DefocusAndShift(grid, transfer.half_columns, transfer.half_rows,
                                               defocus_curvature_per_m, 0, 0);
  Image<std::complex<float>> image(columns, rows);
  for (int k = -transfer.half_columns; k <= transfer.half_columns; ++k) {
    const std::complex<float>* column = transfer.Column(k);
    for (int l = -transfer.half_rows; l <= transfer.half_rows; ++l) {
      image.At((l + rows) % rows, (k + columns) % columns) =
          column[l] * phase.columns[k + transfer.half_columns] * phase.rows[l + transfer.half_rows];
    }
  }
  return image;
}

}  // namespace sightline
