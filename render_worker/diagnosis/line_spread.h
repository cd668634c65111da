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

// Mean irradiance of the pixels' centres row_px ... of one column, from the ideal irradiance
// sampled `samples_per_px` times a pixel; `ideal` starts `margin_px` before the first row and ends
// `margin_px` after the last, and is as long as a power of two. Transfer, then the pixel's own
// width.
std::vector<double> BlurAcrossLine(const std::vector<double>& ideal, int samples_per_px,
                                   int margin_px, int rows_px, double pixel_pitch_m,
                                   const std::vector<std::complex<double>>& transfer);

}  // namespace sightline
