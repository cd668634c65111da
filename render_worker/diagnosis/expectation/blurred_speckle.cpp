// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/expectation/blurred_speckle.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <numbers>
#include <utility>

#include "core/image/image.h"

namespace sightline {

namespace {

constexpr int kPeriod = 32;  // of the kernel [px]
constexpr int kRowReach = 4, kColumnReach = 3;

using Samples = std::array<std::complex<double>, kPeriod>;

// Values of a function of this spectrum at -reach, ..., reach.
std::vector<std::complex<double>> Inverse(const Samples& spectrum, int reach) {
  static const Samples wave = [] {
    Samples turn;
    for (int k = 0; k < kPeriod; ++k) {
      turn[k] = std::polar(1.0 / kPeriod, 2 * std::numbers::pi * k / kPeriod);
    }
    return turn;
  }();
  std::vector<std::complex<double>> values(2 * reach + 1);
  for (int i = -reach; i <= reach; ++i) {
    for (int k = 0; k < kPeriod; ++k) {
      values[i + reach] += spectrum[k] * wave[(k * (i + kPeriod)) % kPeriod];
    }
  }
  return values;
}

struct BlurKernel {
  Image<double> part;     // of the light of pixels around that a pixel gets, itself in the middle
  double shift_rows = 0;  // of the whole image besides
};

BlurKernel MakeKernel(std::span<const TransferFunction> factors, double pixel_pitch_m) {
  const auto frequency = [&](int k) {
    return (k < kPeriod / 2 ? k : k - kPeriod) / (kPeriod * pixel_pitch_m);
  };
  const auto transfer = [&](int column, int row) {
    std::complex<double> product = 1;
    for (const TransferFunction& factor : factors) {
      product *= factor(frequency(column), frequency(row));
    }
    return product;
  };
  bool across_only = true;
  for (const int row : {0, kPeriod / 4, kPeriod / 2}) {
    const auto differs = [&](int column) {
      return std::abs(transfer(column, row) - transfer(0, row)) > 1e-9;
    };
    across_only = across_only && !differs(1) && !differs(kPeriod / 2);
  }
  if (across_only) {
    // A shift by parts of a pixel would make the kernel ring.
    constexpr double kTurnsPerRow = 1e-3;
    std::complex<double> slow = 1;
    for (const TransferFunction& factor : factors) slow *= factor(0, kTurnsPerRow / pixel_pitch_m);
    const double shift_rows = -std::arg(slow) / (2 * std::numbers::pi * kTurnsPerRow);
    constexpr int kReach = kPeriod / 2 - 1;
    Samples spectrum;
    for (int row = 0; row < kPeriod; ++row) {
      const double turns = frequency(row) * pixel_pitch_m * shift_rows;
      spectrum[row] = transfer(0, row) * std::polar(1.0, 2 * std::numbers::pi * turns);
    }
    const std::vector<std::complex<double>> values = Inverse(spectrum, kReach);
    Image<double> kernel(1, 2 * kReach + 1);
    for (size_t i = 0; i < values.size(); ++i) kernel.values[i] = values[i].real();
    return {std::move(kernel), shift_rows};
  }
  std::array<std::vector<std::complex<double>>, kPeriod> along;  // of every row's frequency
  for (int row = 0; row < kPeriod; ++row) {
    Samples spectrum;
    for (int column = 0; column < kPeriod; ++column) spectrum[column] = transfer(column, row);
    along[row] = Inverse(spectrum, kColumnReach);
  }
  Image<double> kernel(2 * kColumnReach + 1, 2 * kRowReach + 1);
  for (int column = 0; column < kernel.columns_px; ++column) {
    Samples spectrum;
    for (int row = 0; row < kPeriod; ++row) spectrum[row] = along[row][column];
    const std::vector<std::complex<double>> values = Inverse(spectrum, kRowReach);
    for (int row = 0; row < kernel.rows_px; ++row) kernel.At(row, column) = values[row].real();
  }
  return {std::move(kernel), 0};
}

}  // namespace

LineSpeckle BlurredSpeckle(const LineSpeckle& speckle, std::span<const TransferFunction> factors,
                           double pixel_pitch_m, double first_v_m,
                           const std::vector<double>& before, const std::vector<double>& after) {
  const BlurKernel kernel = MakeKernel(factors, pixel_pitch_m);
  const int rows = static_cast<int>(before.size());
  const int reach = kernel.part.rows_px / 2;
  const auto light_at = [&](double row) {
    const int first = static_cast<int>(std::floor(row));
    if (first < 0 || first + 1 >= rows) return 0.0;
    return before[first] + (row - first) * (before[first + 1] - before[first]);
  };
  std::vector<SpecklePixelCovariance> covariances;
  for (int place = 0; place < speckle.places(); ++place) {
    const double middle = (speckle.PlaceCentre_m(place) - first_v_m) / pixel_pitch_m;
    const int row = std::clamp(static_cast<int>(std::lround(middle)), 0, rows - 1);
    covariances.push_back(speckle.At(place));
    if (!(after[row] > 0)) continue;
    Image<double> shares = kernel.part;
    for (int i = 0; i < shares.rows_px; ++i) {
      const double share = light_at(row - (i - reach) - kernel.shift_rows) / after[row];
      for (int column = 0; column < shares.columns_px; ++column) shares.At(i, column) *= share;
    }
    // In next to no light shares mean nothing.
    SpecklePixelCovariance blurred = speckle.At(place).Shared(shares);
    if (blurred.At(0, 0) > 0 && blurred.At(0, 0) <= 1) covariances.back() = std::move(blurred);
  }
  return speckle.With(std::move(covariances));
}

}  // namespace sightline
