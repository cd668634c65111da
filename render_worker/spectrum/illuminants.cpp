// SPDX-License-Identifier: Apache-2.0
#include "render_worker/spectrum/illuminants.h"

#include <array>
#include <cmath>

#include "core/physics/constants.h"

namespace sightline {
namespace {

// 360 to 830 nm.
constexpr std::array<double, 48> kD65 = {
    46.6383, 52.0891, 49.9755, 54.6482, 82.7549, 91.486,  93.4318, 86.6823, 104.865, 117.008,
    117.812, 114.861, 115.923, 108.811, 109.354, 107.802, 104.79,  107.689, 104.405, 104.046,
    100.0,   96.3342, 95.788,  88.6856, 90.0062, 89.5991, 87.6987, 83.2886, 83.6992, 80.0268,
    80.2146, 82.2778, 78.2842, 69.7213, 71.6091, 74.349,  61.604,  69.8856, 75.087,  63.5927,
    46.4182, 66.8054, 63.3828, 64.304,  59.4519, 51.959,  57.4406, 60.3125};

// 380 to 780 nm.
constexpr std::array<double, 81> kF2 = {
    1.18,  1.48,  1.84,  2.15,  3.44,  15.69, 3.85,  3.74,  4.19,  4.62,  5.06,  34.98,
    11.81, 6.27,  6.63,  6.93,  7.19,  7.40,  7.54,  7.62,  7.65,  7.62,  7.62,  7.45,
    7.28,  7.15,  7.05,  7.04,  7.16,  7.47,  8.04,  8.88,  10.01, 24.88, 16.64, 14.59,
    16.16, 17.56, 18.62, 21.47, 22.79, 19.29, 18.66, 17.73, 16.54, 15.21, 13.80, 12.36,
    10.95, 9.65,  8.40,  7.32,  6.31,  5.43,  4.68,  4.02,  3.45,  2.96,  2.55,  2.19,
    1.89,  1.64,  1.53,  1.27,  1.10,  0.99,  0.88,  0.76,  0.68,  0.61,  0.56,  0.54,
    0.51,  0.47,  0.47,  0.43,  0.46,  0.47,  0.40,  0.33,  0.27};

double Band(double wavelength_nm, double peak_nm, double sigma_below_nm, double sigma_above_nm) {
  const double offset = wavelength_nm - peak_nm;
  const double scaled = offset / (offset < 0 ? sigma_below_nm : sigma_above_nm);
  return std::exp(-0.5 * scaled * scaled);
}

}  // namespace

double PlanckRadiance(double wavelength_m, double temperature_k) {
  const double exponent =
      kPlanck_j_s * kSpeedOfLight_m_per_s / (wavelength_m * kBoltzmann_j_per_k * temperature_k);
  return 2 * kPlanck_j_s * kSpeedOfLight_m_per_s * kSpeedOfLight_m_per_s /
         (std::pow(wavelength_m, 5) * std::expm1(exponent));
}

double LedWhite4000K(double wavelength_m) {
  const double nm = wavelength_m * 1e9;
  return Band(nm, 450, 9, 9) + Band(nm, 580, 60, 60);
}

TabulatedIlluminant StandardIlluminantD65() { return {360e-9, 10e-9, kD65}; }

TabulatedIlluminant FluorescentF2() { return {380e-9, 5e-9, kF2}; }

}  // namespace sightline
