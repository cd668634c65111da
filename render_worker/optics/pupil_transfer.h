// SPDX-License-Identifier: Apache-2.0
// The generalised pupil at the frequencies of a transform.
#pragma once

#include "render_worker/optics/band_transform.h"
#include "render_worker/optics/pupil.h"

namespace sightline {

// Relation between frequencies of a transform and positions in the pupil, r = lambda b q.
struct TransferGrid {
  double wavelength_m = 0;
  double image_distance_m = 0;
  double sample_pitch_m = 0;
  int columns = 0;  // period
  int rows = 0;

  double FrequencyU(int k) const { return k / (columns * sample_pitch_m); }
  double FrequencyV(int l) const { return l / (rows * sample_pitch_m); }
  // Half widths of the band that contains the pupil.
  int HalfColumns(const Pupil& pupil) const;
  int HalfRows(const Pupil& pupil) const;
};

// c P(lambda b q) exp(i 2 pi W / lambda) without defocus; c such that the mean of |H|^2 over all
// frequencies of the period is 1. All 0 if nothing passes.
BandSpectrum PupilTransfer(const Pupil& pupil, const TransferGrid& grid, int threads);

// Phase factors of the columns and rows of a band; their product is the phase at (k, l).
struct SeparablePhase {
  std::vector<std::complex<float>> columns, rows;
};
// exp(i 2 pi W / lambda) of defocus, W = -1/2 curvature |lambda b q|^2 (thesis eq. 5.6), times
// exp(-i 2 pi q s), which shifts the field by s [samples].
SeparablePhase DefocusAndShift(const TransferGrid& grid, int half_columns, int half_rows,
                               double curvature_per_m, double shift_columns, double shift_rows);

}  // namespace sightline
