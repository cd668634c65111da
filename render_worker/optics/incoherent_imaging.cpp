// SPDX-License-Identifier: Apache-2.0
#include "render_worker/optics/incoherent_imaging.h"

#include <algorithm>
#include <cassert>

#include "render_worker/optics/band_transform.h"
#include "render_worker/optics/clear_fraction_map.h"
#include "render_worker/optics/complex_product.h"
#include "render_worker/optics/fourier.h"
#include "render_worker/optics/optical_transfer.h"
#include "render_worker/optics/parallel_rows.h"
#include "render_worker/optics/pupil_transfer.h"

namespace sightline {

Image<float> ImageIncoherent(const Image<float>& light, const SubPixelGrid& grid,
                             double wavelength_m, const OpticsModel& optics, int threads) {
  assert(light.columns_px == grid.columns() && light.rows_px == grid.rows());
  const RegionOfInterest& roi = grid.roi;
  const int os = grid.sub_pixels;
  const TransferGrid frequencies = {wavelength_m, optics.image_distance_m, grid.pixel_pitch_m / os,
                                    FastLength(grid.columns(), os), FastLength(grid.rows(), os)};
  const ClearFractionMap clear(optics, grid, threads);
  const Pupil pupil =
      optics.field_dependent
          ? optics.pupil((roi.column_px + 0.5 * (roi.columns_px - 1)) * grid.pixel_pitch_m,
                         (roi.row_px + 0.5 * (roi.rows_px - 1)) * grid.pixel_pitch_m)
          : optics.pupil(0, 0);
  const OpticalTransferTable transfer(pupil, wavelength_m, optics.image_distance_m);
  const BandTransform transform(frequencies.columns, frequencies.rows, frequencies.columns / 2,
                                frequencies.rows / 2, threads);
  // Samples added to reach a fast length repeat the rim, half of them the opposite one: an even
  // image stays even.
  const auto source = [](int index, int length, int period) {
    if (index < length) return index;
    return index - length < (period - length) / 2 ? length - 1 : 0;
  };
  BandSpectrum spectrum =
      transform.Forward(AllRows(frequencies.rows), [&](int row, std::complex<float>* samples) {
        const int from_row = source(row, light.rows_px, frequencies.rows);
        for (int column = 0; column < frequencies.columns; ++column) {
          const int from = source(column, light.columns_px, frequencies.columns);
          samples[column] = light.At(from_row, from) * clear.At(from_row, from);
        }
      });
  const float scale =
      1.0F / (static_cast<float>(frequencies.columns) * static_cast<float>(frequencies.rows));
  ForIndexRanges(threads, spectrum.width(), [&](int begin, int end) {
    for (int c = begin; c < end; ++c) {
      const int k = c - spectrum.half_columns;
      std::complex<float>* column = spectrum.Column(k);
      for (int l = -spectrum.half_rows; l <= spectrum.half_rows; ++l) {
        const double qx = frequencies.FrequencyU(k);
        const double qy = frequencies.FrequencyV(l);
        std::complex<float> factor = transfer.At(qx, qy) * scale;
        for (const TransferFunction& extra : optics.transfer) {
          factor = Product(factor, std::complex<float>(extra(qx, qy)));
        }
        column[l] = Product(column[l], factor);
      }
    }
  });
  Image<float> row_means(roi.columns_px, grid.rows());
  transform.Backward(spectrum, [&](int row, std::complex<float>* samples) {
    if (row >= grid.rows()) return;
    for (int j = 0; j < roi.columns_px; ++j) {
      float sum = 0;
      for (int s = 0; s < os; ++s) sum += samples[(j + grid.margin_px) * os + s].real();
      row_means.At(row, j) = sum / static_cast<float>(os);
    }
  });
  Image<float> pixels(roi.columns_px, roi.rows_px);
  for (int i = 0; i < roi.rows_px; ++i) {
    for (int j = 0; j < roi.columns_px; ++j) {
      float sum = 0;
      for (int s = 0; s < os; ++s) sum += row_means.At((i + grid.margin_px) * os + s, j);
      // Ringing of the ended band may go below zero by a little; light does not.
      pixels.At(i, j) = std::max(0.0F, sum / static_cast<float>(os));
    }
  }
  return pixels;
}

}  // namespace sightline
