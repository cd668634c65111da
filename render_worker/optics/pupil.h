// SPDX-License-Identifier: Apache-2.0
// The lens's exit pupil: shape, wavefront error and diffraction.
#pragma once

#include <compare>
#include <complex>
#include <vector>

#include "core/image/image.h"
#include "core/rig/rig.h"

namespace sightline {

// W(r, phi) = coefficient (r / reference_radius)^radial_power cos^cosine_power(phi - axis): Seidel
// form, for aberrations that depend on the field.
struct SeidelTerm {
  double coefficient_m = 0;
  double reference_radius_m = 1;
  int radial_power = 0;
  int cosine_power = 0;
  double axis_rad = 0;

  auto operator<=>(const SeidelTerm&) const = default;
};

// A disc that also limits the light (the rims of other lenses).
struct PupilClip {
  double centre_u_m = 0;
  double centre_v_m = 0;
  double radius_m = 0;

  auto operator<=>(const PupilClip&) const = default;
};

struct Pupil {
  double radius_m = 0;
  double obstruction_radius_m = 0;
  int blades = 0;  // 0: circle; else a regular polygon of the circle's area
  double rotation_rad = 0;
  std::vector<double> zernike_m;  // Noll's index 1, 2, ..., normalised to radius_m; rms metres
  std::vector<SeidelTerm> seidel;
  std::vector<PupilClip> clips;

  // 1 inside, 0 outside.
  double Transmission(double x_m, double y_m) const;
  // Wavefront error without defocus [m].
  double WavefrontError(double x_m, double y_m) const;
  // Radius outside which nothing passes [m].
  double OuterRadius() const;
  // True for a full circle (clips that do not cut are ignored).
  bool IsFullCircle() const;
  bool HasWavefrontError() const { return !zernike_m.empty() || !seidel.empty(); }

  auto operator<=>(const Pupil&) const = default;
};

// Thin lens of the frame: D = f/N, blades, obstruction, Zernike terms.
Pupil MakePupil(const Lens& lens);

// Light that passes the pupil relative to the full circle of radius_m, in [0, 1]; by strips of
// exact width, error below 1e-5. Exactly 1 for the full circle.
double ClearFraction(const Pupil& pupil);

// Wavefront error of defocus: W = -1/2 (1/b' - 1/b) r^2 (thesis eq. 5.6), with the
// image distance b' of the object and b of the sensor. Returns the curvature 1/b' - 1/b
// [1/m].
double DefocusCurvature(double focal_length_m, double object_distance_m, double image_distance_m);

// Highest frequency of the field on the sensor, OuterRadius / (lambda b) [1/m].
double CutOffFrequency(const Pupil& pupil, double wavelength_m, double image_distance_m);

// Zernike polynomial of Noll's index (1: piston, 2: tilt x, 3: tilt y, 4: defocus, ...) at (rho,
// phi), rho in [0, 1]; its mean square over the unit disc is 1 (Noll, J. Opt. Soc. Am. 66, 207,
// 1976).
double ZernikeNoll(int index, double rho, double phi_rad);

// Amplitude transfer function H(q) = c P(lambda b q) exp(i 2 pi W / lambda) (thesis eq.
// 4.23-4.25) at the frequencies of an FFT of columns x rows samples of sample_pitch_m, in FFT
// order, complex conjugate-free; c such that the mean of |H|^2 over the grid is 1.
// `defocus_curvature_per_m` is 1/b' - 1/b. The caller must ensure that the cut-off is below the
// grid's Nyquist frequency.
Image<std::complex<float>> AmplitudeTransfer(const Pupil& pupil, double wavelength_m,
                                             double image_distance_m,
                                             double defocus_curvature_per_m, int columns, int rows,
                                             double sample_pitch_m);

// Incoherent optical transfer function: normalised autocorrelation of the pupil at frequency (qx,
// qy) [1/m]; 1 at 0. It excludes defocus, which the incoherent image already contains.
std::complex<double> OpticalTransfer(const Pupil& pupil, double wavelength_m,
                                     double image_distance_m, double qx_per_m, double qy_per_m);

// Least integer >= 2 with cut-off D/(2 lambda b) <= sub_pixels/(4 p): intensity of the field is
// then not aliased.
int RequiredSubPixels(double pupil_diameter_m, double wavelength_m, double image_distance_m,
                      double pixel_pitch_m);

}  // namespace sightline
