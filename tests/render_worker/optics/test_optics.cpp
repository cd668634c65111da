// SPDX-License-Identifier: Apache-2.0
#include "test_optics.h"

#include <cmath>
#include <numbers>

namespace sightline::optics_test {

double PupilRadius(double cut_off_per_px) {
  return cut_off_per_px / kPitch_m * kWavelength_m * kImageDistance_m;
}

double Curvature(double depth_m) { return 1 / kFocus_m - 1 / depth_m; }

OpticsModel ClearLens(double cut_off_per_px) {
  OpticsModel optics;
  Pupil pupil;
  pupil.radius_m = PupilRadius(cut_off_per_px);
  optics.pupil = [pupil](double, double) { return pupil; };
  optics.curvature = [](double depth_m, double, double) { return Curvature(depth_m); };
  optics.image_distance_m = kImageDistance_m;
  optics.wavelength_m = kWavelength_m;
  optics.reference_pupil_radius_m = pupil.radius_m;
  return optics;
}

IdealImage EvenImage(int columns_px, int rows_px, int sub_pixels, int margin_px) {
  IdealImage image;
  image.grid = {
      {-columns_px / 2, -rows_px / 2, columns_px, rows_px}, sub_pixels, margin_px, kPitch_m};
  image.laser_irradiance_w_m2 = Image<float>(image.grid.columns(), image.grid.rows(), 1.0F);
  image.constant_depth_m = kFocus_m;
  return image;
}

double SquaredCoherence(double cut_off_per_px, double distance_px) {
  const double v = 2 * std::numbers::pi * cut_off_per_px * distance_px;
  if (v < 1e-6) return 1;
  const double mu = 2 * std::cyl_bessel_j(1, v) / v;
  return mu * mu;
}

double PixelCorrelation(double cut_off_per_px, double dx_px, double dy_px) {
  // Difference of two places in pixels is triangularly distributed.
  constexpr int kSteps = 160;
  double sum = 0;
  for (int i = 0; i < kSteps; ++i) {
    const double y = 2 * (i + 0.5) / kSteps - 1;
    for (int j = 0; j < kSteps; ++j) {
      const double x = 2 * (j + 0.5) / kSteps - 1;
      sum += (1 - std::abs(x)) * (1 - std::abs(y)) *
             SquaredCoherence(cut_off_per_px, std::hypot(dx_px + x, dy_px + y));
    }
  }
  return sum * 4 / (kSteps * kSteps);
}

Moments MomentsOf(const Image<float>& image) {
  double sum = 0, squares = 0;
  for (const float value : image.values) {
    sum += value;
    squares += static_cast<double>(value) * value;
  }
  const double n = static_cast<double>(image.values.size());
  const double mean = sum / n;
  return {mean, std::sqrt(squares / n - mean * mean) / mean};
}

}  // namespace sightline::optics_test
