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

// The view along the plate's normal of version 1.
ObliqueView PerpendicularView(double incidence_rad) {
  const double half = std::cos(incidence_rad / 2);
  return {
      .incidence_angle_rad = incidence_rad, .half_normal_cosine = half, .half_ray_cosine = half};
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
  const ObliqueView view = image.view ? *image.view : PerpendicularView(set.incidence_angle_rad);
  const double cosine = std::cos(view.incidence_angle_rad);

  ExpectedLine line;
  line.row_px = magnification * image.line_offset_m / pitch - image.roi_row_px;
  const double waist = set.laser.beam_quality_m2 * lambda / (pi * set.laser.divergence_rad);
  const double beam = std::hypot(
      waist, set.laser.divergence_rad * (image.laser_distance_m - set.laser.beam_focus_distance_m));
  const double sigma =  // of the line's image
      std::hypot(beam / 2 / cosine * magnification * view.width_factor,
                 std::sqrt(view.row_variance_px2) * pitch);
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
  const double irradiance_m = set.laser.power_w / length * view.width_factor *
                              ObliqueBrdf(set.surface.diffuse_albedo, set.surface.specular_f0,
                                          set.surface.ggx_alpha, view) *
                              pi / 4 * set.transmission * (pupil / b) * (pupil / b) * cos_squared *
                              cos_squared * magnification;
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
