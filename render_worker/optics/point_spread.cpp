// SPDX-License-Identifier: Apache-2.0
// How far light spreads.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "render_worker/optics/fourier.h"
#include "render_worker/optics/image_optics.h"

namespace sightline {
namespace {

using std::numbers::pi;

// An almost closed pupil would spread its light over metres, more than memory and an int hold.
constexpr double kLargestMargin_px = 1024;

// Largest slope of the wavefront, times the image distance: geometric radius of the spread light.
double GeometricRadius(const Pupil& pupil, double image_distance_m, double curvature_per_m) {
  const double outer = pupil.OuterRadius();
  double largest = outer * std::abs(curvature_per_m);
  if (pupil.HasWavefrontError()) {
    constexpr int kSteps = 48;
    const double h = outer / kSteps;
    for (int i = -kSteps; i <= kSteps; ++i) {
      for (int j = -kSteps; j <= kSteps; ++j) {
        const double x = j * h;
        const double y = i * h;
        if (pupil.Transmission(x, y) == 0) continue;
        const double d = h / 4;
        const double slope_x =
            (pupil.WavefrontError(x + d, y) - pupil.WavefrontError(x - d, y)) / (2 * d);
        const double slope_y =
            (pupil.WavefrontError(x, y + d) - pupil.WavefrontError(x, y - d)) / (2 * d);
        largest = std::max(
            largest, std::hypot(slope_x - curvature_per_m * x, slope_y - curvature_per_m * y));
        largest = std::max(
            largest, std::hypot(slope_x + curvature_per_m * x, slope_y + curvature_per_m * y));
      }
    }
  }
  return largest * image_distance_m;
}

// Radius beyond which a hard edge of the pupil diffracts the share `lost`: far from the image point
// the share beyond r is lambda b L / (2 pi^2 r A) for a pupil of area A and rim L, 4 lambda b /
// (2 pi^2 r D) for the circle (asymptote of 1 - J0^2 - J1^2). What is left of a pupil by discs that
// cut it has a rim no longer than that of the smallest.
double DiffractionRadius(const Pupil& pupil, double wavelength_m, double image_distance_m,
                         double lost) {
  const double area = ClearFraction(pupil) * pi * pupil.radius_m * pupil.radius_m;
  if (area <= 0) return 0;
  double outer = pupil.OuterRadius();
  for (const PupilClip& clip : pupil.clips) outer = std::min(outer, clip.radius_m);
  const double rim = 2 * pi * (outer + pupil.obstruction_radius_m);
  return wavelength_m * image_distance_m * rim / (2 * pi * pi * area * lost);
}

// Distance beyond which the line spread of a transfer function holds less than the share `lost`.
double TransferReach(const TransferFunction& transfer, bool along_u, double pixel_pitch_m,
                     double lost) {
  constexpr int kLength = 8192;
  // Blurred by a Gaussian, so that the end of the band leaves no side lobes.
  constexpr double kBlur_px = 1.5;
  FourierBuffer<std::complex<float>> line(FourierStride(kLength));
  for (int k = -kLength / 2; k < kLength / 2; ++k) {
    const double q = k / (kLength * pixel_pitch_m);
    const double blur = std::exp(-2 * std::pow(pi * q * pixel_pitch_m * kBlur_px, 2));
    line[(k + kLength) % kLength] =
        std::complex<float>(blur * (along_u ? transfer(q, 0) : transfer(0, q)));
  }
  FourierPlan(FourierPlan::Direction::kBackward, kLength).Run(line.data());
  double outside = 0;
  int reach = kLength / 2;
  while (reach > 1) {
    outside += std::abs(line[reach - 1]) + std::abs(line[kLength - reach + 1]);
    if (outside > lost * kLength) break;
    --reach;
  }
  return reach * pixel_pitch_m;
}

}  // namespace

int RequiredMargin(const OpticsModel& optics, double largest_curvature_per_m, double pixel_pitch_m,
                   double field_radius_m, double lost_energy) {
  double reach_m = 0;
  const double d = field_radius_m / std::numbers::sqrt2;
  const int points = optics.field_dependent && field_radius_m > 0 ? 5 : 1;
  constexpr double kSigns[5][2] = {{0, 0}, {1, 1}, {1, -1}, {-1, 1}, {-1, -1}};
  for (int i = 0; i < points; ++i) {
    const Pupil pupil = optics.pupil(kSigns[i][0] * d, kSigns[i][1] * d);
    reach_m = std::max(
        reach_m,
        GeometricRadius(pupil, optics.image_distance_m, largest_curvature_per_m) +
            DiffractionRadius(pupil, optics.wavelength_m, optics.image_distance_m, lost_energy));
  }
  for (const TransferFunction& transfer : optics.transfer) {
    reach_m += std::max(TransferReach(transfer, true, pixel_pitch_m, lost_energy),
                        TransferReach(transfer, false, pixel_pitch_m, lost_energy));
  }
  const double reach_px = std::ceil(reach_m / pixel_pitch_m) + 2;
  return static_cast<int>(std::min(reach_px, kLargestMargin_px));
}

}  // namespace sightline
