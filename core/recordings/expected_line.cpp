// SPDX-License-Identifier: Apache-2.0
#include "core/recordings/expected_line.h"

#include <algorithm>
#include <boost/math/special_functions/sinc.hpp>
#include <cmath>
#include <numbers>

#include "core/physics/constants.h"

namespace sightline {
namespace {

using std::numbers::pi;

// Transfer function of a uniform disc of diameter d at frequency q.
double DiscTransfer(double q, double diameter) {
  const double x = pi * q * diameter;
  return x < 1e-6 ? 1 : 2 * std::cyl_bessel_j(1.0, x) / x;
}

// Diffraction MTF of a round pupil without aberrations; `s` is the frequency over its cut-off.
double DiffractionTransfer(double s) {
  return s >= 1 ? 0 : 2 / pi * (std::acos(s) - s * std::sqrt(1 - s * s));
}

// Radiance over irradiance [1/sr] of Lambert + GGX for light at `incidence` and a view along the
// normal.
double Brdf(const RecordedSurface& surface, double incidence_rad) {
  const double half = std::cos(incidence_rad / 2);
  const double alpha2 = surface.ggx_alpha * surface.ggx_alpha;
  const double tangent = std::tan(incidence_rad);
  const double base = half * half * (alpha2 - 1) + 1;
  const double lobe = alpha2 / (pi * base * base) *
                      (surface.specular_f0 + (1 - surface.specular_f0) * std::pow(1 - half, 5)) *
                      2 / (1 + std::sqrt(1 + alpha2 * tangent * tangent));
  return surface.diffuse_albedo / pi + lobe / (4 * std::cos(incidence_rad));
}

}  // namespace

ExpectedLine ExpectLine(const RecordingSet& set, const RecordedImage& image) {
  const Sensor& sensor = set.camera;
  const double f = set.focal_length_m;
  const double lambda = set.laser.wavelength_m;
  const double pitch = sensor.pixel_pitch_m;
  const double pupil = f / image.f_number;
  const double b = 1 / (1 / f - 1 / image.focus_distance_m);
  const double plate_b = 1 / (1 / f - 1 / image.camera_distance_m);
  const double magnification = b / image.camera_distance_m;
  const double cosine = std::cos(set.incidence_angle_rad);

  ExpectedLine line;
  line.row_px = magnification * image.line_offset_m / pitch - image.roi_row_px;
  const double waist = set.laser.beam_quality_m2 * lambda / (pi * set.laser.divergence_rad);
  const double beam = std::hypot(
      waist, set.laser.divergence_rad * (image.laser_distance_m - set.laser.beam_focus_distance_m));
  const double sigma = beam / 2 / cosine * magnification;  // of the line's image
  const double disc = pupil * std::abs(1 - b / plate_b);
  const double cut_off = pupil / (lambda * b);
  // A disc seen edge on has a standard deviation of a quarter of its diameter.
  line.width_px = std::hypot(std::hypot(sigma, disc / 4), 0.5 / cut_off) / pitch;

  // Irradiance integrated across the line. Projected on the plate, P/L is spread over s; the middle
  // column and the line's own field angle set cos^4.
  const double length = 2 * image.laser_distance_m * std::tan(set.laser.fan_angle_rad / 2);
  const double u = (image.roi_column_px + image.roi_columns_px / 2.0) * pitch;
  const double v = magnification * image.line_offset_m;
  const double cos_squared = 1 / (1 + (u * u + v * v) / (b * b));
  const double irradiance_m =
      set.laser.power_w / length * Brdf(set.surface, set.incidence_angle_rad) * pi / 4 *
      set.transmission * (pupil / b) * (pupil / b) * cos_squared * cos_squared * magnification;
  const double photons =
      irradiance_m * pitch * image.exposure_time_s * lambda / (kPlanck_j_s * kSpeedOfLight_m_per_s);
  for (int channel = 0; channel < sensor.channels(); ++channel) {
    line.electrons_per_column[channel] = photons * sensor.quantum_efficiency[channel].At(lambda);
  }

  // Value at the centre of the convolution of all: integral of the product of the transfers.
  constexpr int kSteps = 2000;
  const double last = std::min(cut_off, 1.2 / sigma);
  double integral = 0;
  for (int i = 0; i < kSteps; ++i) {
    const double q = (i + 0.5) * last / kSteps;
    const double beam_transfer = std::exp(-2 * pi * pi * sigma * sigma * q * q);
    integral += beam_transfer * DiffractionTransfer(q / cut_off) * DiscTransfer(q, disc) *
                boost::math::sinc_pi(pi * q * pitch);
  }
  line.crest_fraction = std::clamp(2 * integral * last / kSteps * pitch, 0.0, 1.0);

  const double speckle_area = lambda * lambda * b * b / (pi / 4 * pupil * pupil);
  line.speckle_contrast_squared = 1 / (1 + pitch * pitch / speckle_area);
  return line;
}

}  // namespace sightline
