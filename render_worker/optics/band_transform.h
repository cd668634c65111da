// SPDX-License-Identifier: Apache-2.0
// Two-dimensional Fourier transform of signals with empty rows and of spectra limited to the
// pupil's band. Empty rows, and columns outside the band, take no time.
#pragma once

#include <complex>
#include <functional>
#include <span>
#include <vector>

namespace sightline {

// Spectrum at frequencies |k| <= half width: value (k, l), k along the rows, l down the columns.
struct BandSpectrum {
  int half_columns = 0;
  int half_rows = 0;
  std::vector<std::complex<float>> values;  // l runs fastest

  BandSpectrum(int half_columns_in, int half_rows_in)
      : half_columns(half_columns_in),
        half_rows(half_rows_in),
        values(static_cast<size_t>(2 * half_columns_in + 1) * (2 * half_rows_in + 1)) {}
  int width() const { return 2 * half_columns + 1; }
  int height() const { return 2 * half_rows + 1; }
  std::complex<float>* Column(int k) {
    return values.data() + static_cast<size_t>(k + half_columns) * height() + half_rows;
  }
  const std::complex<float>* Column(int k) const {
    return values.data() + static_cast<size_t>(k + half_columns) * height() + half_rows;
  }
};

class BandTransform {
 public:
  // Period of columns x rows samples. Half widths are limited to (length - 1) / 2.
  BandTransform(int columns, int rows, int half_columns, int half_rows, int threads);

  int columns() const { return columns_; }
  int rows() const { return rows_; }
  int half_columns() const { return half_columns_; }
  int half_rows() const { return half_rows_; }

  // Writes a row of samples into the zero-filled array of `columns` values. Called from several
  // threads.
  using FillRow = std::function<void(int row, std::complex<float>* samples)>;
  // Reads a row of samples. Called from several threads.
  using TakeRow = std::function<void(int row, std::complex<float>* samples)>;

  // Sum of x exp(-2 pi i (k j / columns + l i / rows)) over the given rows (ascending; all others
  // are zero).
  BandSpectrum Forward(std::span<const int> filled_rows, const FillRow& fill) const;
  // Sum of X exp(+2 pi i ...) over the band, not normalised, for all rows.
  void Backward(const BandSpectrum& spectrum, const TakeRow& take) const;

 private:
  int columns_, rows_, half_columns_, half_rows_, threads_;
};

// 0, 1, ..., count - 1.
std::vector<int> AllRows(int count);

}  // namespace sightline
