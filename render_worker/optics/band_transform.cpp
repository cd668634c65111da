// SPDX-License-Identifier: Apache-2.0
#include "render_worker/optics/band_transform.h"

#include <algorithm>
#include <numeric>

#include "render_worker/optics/fourier.h"
#include "render_worker/optics/parallel_rows.h"

namespace sightline {
namespace {

using Complex = std::complex<float>;
// Columns that are gathered together: one cache line.
constexpr int kGroup = 8;

}  // namespace

std::vector<int> AllRows(int count) {
  std::vector<int> rows(static_cast<size_t>(count));
  std::iota(rows.begin(), rows.end(), 0);
  return rows;
}

BandTransform::BandTransform(int columns, int rows, int half_columns, int half_rows, int threads)
    : columns_(columns),
      rows_(rows),
      half_columns_(std::min(half_columns, (columns - 1) / 2)),
      half_rows_(std::min(half_rows, (rows - 1) / 2)),
      threads_(threads) {}

BandSpectrum BandTransform::Forward(std::span<const int> filled_rows, const FillRow& fill) const {
  BandSpectrum spectrum(half_columns_, half_rows_);
  const int width = spectrum.width();
  const int filled = static_cast<int>(filled_rows.size());
  if (filled == 0) return spectrum;
  std::vector<Complex> band(static_cast<size_t>(filled) * width);
  const FourierPlan row_plan(FourierPlan::Direction::kForward, columns_);
  ForIndexRanges(threads_, filled, [&](int begin, int end) {
    FourierBuffer<Complex> line(FourierStride(columns_));
    for (int r = begin; r < end; ++r) {
      line.Clear();
      fill(filled_rows[r], line.data());
      row_plan.Run(line.data());
      Complex* out = band.data() + static_cast<size_t>(r) * width;
      std::copy_n(line.data() + columns_ - half_columns_, half_columns_, out);
      std::copy_n(line.data(), half_columns_ + 1, out + half_columns_);
    }
  });
  const FourierPlan column_plan(FourierPlan::Direction::kForward, rows_);
  ForIndexRanges(threads_, (width + kGroup - 1) / kGroup, [&](int begin, int end) {
    const size_t stride = FourierStride(rows_);
    FourierBuffer<Complex> lines(stride * kGroup);
    for (int group = begin; group < end; ++group) {
      const int first = group * kGroup;
      const int count = std::min(kGroup, width - first);
      lines.Clear();
      for (int r = 0; r < filled; ++r) {
        const Complex* in = band.data() + static_cast<size_t>(r) * width + first;
        for (int c = 0; c < count; ++c) lines[c * stride + filled_rows[r]] = in[c];
      }
      for (int c = 0; c < count; ++c) {
        Complex* line = lines.data() + c * stride;
        column_plan.Run(line);
        Complex* out = spectrum.Column(first + c - half_columns_);
        std::copy_n(line + rows_ - half_rows_, half_rows_, out - half_rows_);
        std::copy_n(line, half_rows_ + 1, out);
      }
    }
  });
  return spectrum;
}

void BandTransform::Backward(const BandSpectrum& spectrum, const TakeRow& take) const {
  const int width = spectrum.width();
  const int half_rows = spectrum.half_rows;
  const int half_columns = spectrum.half_columns;
  std::vector<Complex> band(static_cast<size_t>(rows_) * width);
  const FourierPlan column_plan(FourierPlan::Direction::kBackward, rows_);
  ForIndexRanges(threads_, (width + kGroup - 1) / kGroup, [&](int begin, int end) {
    const size_t stride = FourierStride(rows_);
    FourierBuffer<Complex> lines(stride * kGroup);
    for (int group = begin; group < end; ++group) {
      const int first = group * kGroup;
      const int count = std::min(kGroup, width - first);
      lines.Clear();
      for (int c = 0; c < count; ++c) {
        Complex* line = lines.data() + c * stride;
        const Complex* in = spectrum.Column(first + c - half_columns);
        std::copy_n(in - half_rows, half_rows, line + rows_ - half_rows);
        std::copy_n(in, half_rows + 1, line);
        column_plan.Run(line);
      }
      for (int r = 0; r < rows_; ++r) {
        Complex* out = band.data() + static_cast<size_t>(r) * width + first;
        for (int c = 0; c < count; ++c) out[c] = lines[c * stride + r];
      }
    }
  });
  const FourierPlan row_plan(FourierPlan::Direction::kBackward, columns_);
  ForIndexRanges(threads_, rows_, [&](int begin, int end) {
    FourierBuffer<Complex> line(FourierStride(columns_));
    for (int r = begin; r < end; ++r) {
      line.Clear();
      const Complex* in = band.data() + static_cast<size_t>(r) * width;
      std::copy_n(in, half_columns, line.data() + columns_ - half_columns);
      std::copy_n(in + half_columns, half_columns + 1, line.data());
      row_plan.Run(line.data());
      take(r, line.data());
    }
  });
}

}  // namespace sightline
