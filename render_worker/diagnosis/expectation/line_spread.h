// SPDX-License-Identifier: Apache-2.0
// Image of a long straight line through the lens.
#pragma once

#include <complex>
#include <vector>

#include "render_worker/optics/image_optics.h"

namespace sightline {

// Incoherent transfer function of the generalised pupil, defocus included, at frequencies (0, k
// step), k = 0 ... count - 1, across the line: autocorrelation of the pupil along v (Goodman,
// Introduction to Fourier Optics, 6.3), normalised to 1 at 0.
std::vector<std::complex<double>> LineTransfer(const Pupil& pupil, double wavelength_m,
                                               double image_distance_m,
                                               double defocus_curvature_per_m, double step_per_m,
                                               int count);

// Transfer function of a pixel's width and of the shift from its first sample to its centre, at
// frequencies k = 0 ... length / 2 of `length` samples across the line with `samples_per_px`
// samples per pixel.
std::vector<std::complex<double>> PixelTransfer(int samples_per_px, int length,
                                                double pixel_pitch_m);

// Mean irradiance of `rows_px` pixels of a column, from the ideal irradiance with `samples_per_px`
// samples per pixel. `ideal` starts `margin_px` before the first row; its length is a power of two.
// `transfer`: product for lens and pixel, with half that length plus one element.
std::vector<double> BlurAcrossLine(const std::vector<double>& ideal, int samples_per_px,
                                   int margin_px, int rows_px,
                                   const std::vector<std::complex<double>>& transfer);

}  // namespace sightline
