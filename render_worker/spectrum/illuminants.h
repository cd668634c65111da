// SPDX-License-Identifier: Apache-2.0
// Relative spectral power of standard light sources.
#pragma once

#include <span>

namespace sightline {

// Spectral radiance of a Planckian radiator [W/(m^2 sr m)].
double PlanckRadiance(double wavelength_m, double temperature_k);

// White light-emitting diode, 4000 K: blue chip (450 nm) and a broad phosphor band, a sum of
// Gaussians (shape as of CIE 015:2018 illuminant LED-B3; the numbers are our fit to the Planckian
// chromaticity of 4000 K, not a measured lamp).
double LedWhite4000K(double wavelength_m);

// Values at start_m, start_m + step_m, ...; linear in between.
struct TabulatedIlluminant {
  double start_m;
  double step_m;
  std::span<const double> values;
};

// CIE standard illuminant D65 (ISO/CIE 11664-2), 10 nm table; the standard's own 5 nm values are
// its linear interpolation.
TabulatedIlluminant StandardIlluminantD65();

// CIE illuminant F2 (FL2, CIE 015), cool white fluorescent lamp.
TabulatedIlluminant FluorescentF2();

}  // namespace sightline
