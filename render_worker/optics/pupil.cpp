// SPDX-License-Identifier: Apache-2.0
#include "render_worker/optics/pupil.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstdlib>
#include <numbers>

namespace sightline {
namespace {

using std::numbers::pi;

// Circumradius of the regular polygon with the area of a circle.
double Circumradius(double radius_m, int blades) {
  return radius_m * std::sqrt(2 * pi / (blades * std::sin(2 * pi / blades)));
}

struct Interval {
  double begin, end;
};

void ClipToDisc(Interval& x, double y, double centre_x, double centre_y, double radius) {
  const double square = radius * radius - (y - centre_y) * (y - centre_y);
  if (square <= 0) {
    x.end = x.begin;
    return;
  }
  const double half = std::sqrt(square);
  x.begin = std::max(x.begin, centre_x - half);
  x.end = std::min(x.end, centre_x + half);
}

// Length of the clear part of the line at height y.
double ClearLength(const Pupil& pupil, double y) {
  const double outer = pupil.OuterRadius();
  Interval x = {-outer, outer};
  if (pupil.blades == 0) {
    ClipToDisc(x, y, 0, 0, pupil.radius_m);
  } else {
    const double apothem = Circumradius(pupil.radius_m, pupil.blades) * std::cos(pi / pupil.blades);
    for (int edge = 0; edge < pupil.blades; ++edge) {
      const double normal = pupil.rotation_rad + (2 * edge + 1) * pi / pupil.blades;
      const double limit = apothem - y * std::sin(normal);
      const double slope = std::cos(normal);
      if (std::abs(slope) < 1e-12) {
        if (limit < 0) x.end = x.begin;
      } else if (slope > 0) {
        x.end = std::min(x.end, limit / slope);
      } else {
        x.begin = std::max(x.begin, limit / slope);
      }
    }
  }
  for (const PupilClip& clip : pupil.clips) {
    ClipToDisc(x, y, clip.centre_u_m, clip.centre_v_m, clip.radius_m);
  }
  if (x.end <= x.begin) return 0;
  double length = x.end - x.begin;
  if (std::abs(y) < pupil.obstruction_radius_m) {
    const double half = std::sqrt(pupil.obstruction_radius_m * pupil.obstruction_radius_m - y * y);
    length -= std::max(0.0, std::min(x.end, half) - std::max(x.begin, -half));
  }
  return length;
}

}  // namespace

double Pupil::OuterRadius() const {
  return blades == 0 ? radius_m : Circumradius(radius_m, blades);
}

bool Pupil::IsFullCircle() const {
  return blades == 0 && obstruction_radius_m <= 0 &&
         std::all_of(clips.begin(), clips.end(), [&](const PupilClip& clip) {
           return std::hypot(clip.centre_u_m, clip.centre_v_m) + radius_m <= clip.radius_m;
         });
}

double Pupil::Transmission(double x_m, double y_m) const {
  const double square = x_m * x_m + y_m * y_m;
  if (blades == 0) {
    if (square > radius_m * radius_m) return 0;
  } else {
    const double sector = 2 * pi / blades;
    double angle = std::fmod(std::atan2(y_m, x_m) - rotation_rad, sector);
    if (angle < 0) angle += sector;
    if (std::sqrt(square) * std::cos(angle - sector / 2) >
        Circumradius(radius_m, blades) * std::cos(sector / 2)) {
      return 0;
    }
  }
  if (square < obstruction_radius_m * obstruction_radius_m) return 0;
  for (const PupilClip& clip : clips) {
    const double dx = x_m - clip.centre_u_m;
    const double dy = y_m - clip.centre_v_m;
    if (dx * dx + dy * dy > clip.radius_m * clip.radius_m) return 0;
  }
  return 1;
}

double Pupil::WavefrontError(double x_m, double y_m) const {
  if (!HasWavefrontError()) return 0;
  const double r = std::hypot(x_m, y_m);
  const double phi = std::atan2(y_m, x_m);
  double error = 0;
  for (size_t i = 0; i < zernike_m.size(); ++i) {
    if (zernike_m[i] == 0) continue;
    error += zernike_m[i] * ZernikeNoll(static_cast<int>(i) + 1, r / radius_m, phi);
  }
  for (const SeidelTerm& term : seidel) {
    error += term.coefficient_m * std::pow(r / term.reference_radius_m, term.radial_power) *
             std::pow(std::cos(phi - term.axis_rad), term.cosine_power);
  }
  return error;
}

Pupil MakePupil(const Lens& lens) {
  Pupil pupil;
  pupil.radius_m = lens.focal_length_m / lens.f_number / 2;
  pupil.obstruction_radius_m = lens.obstruction_relative * pupil.radius_m;
  pupil.blades = lens.aperture_blades;
  pupil.rotation_rad = lens.aperture_rotation_rad;
  pupil.zernike_m = lens.zernike_m;
  return pupil;
}

double ClearFraction(const Pupil& pupil) {
  if (pupil.IsFullCircle()) return 1;
  constexpr int kStrips = 2048;
  const double outer = pupil.OuterRadius();
  // y = outer sin(t): strips get thin where a circle's edge is flat, which the midpoint rule likes.
  double area = 0;
  for (int i = 0; i < kStrips; ++i) {
    const double t = pi * ((i + 0.5) / kStrips - 0.5);
    area += ClearLength(pupil, outer * std::sin(t)) * std::cos(t);
  }
  area *= outer * pi / kStrips;
  return std::clamp(area / (pi * pupil.radius_m * pupil.radius_m), 0.0, 1.0);
}

double DefocusCurvature(double focal_length_m, double object_distance_m, double image_distance_m) {
  return 1 / focal_length_m - 1 / object_distance_m - 1 / image_distance_m;
}

double CutOffFrequency(const Pupil& pupil, double wavelength_m, double image_distance_m) {
  return pupil.OuterRadius() / (wavelength_m * image_distance_m);
}

int RequiredSubPixels(double pupil_diameter_m, double wavelength_m, double image_distance_m,
                      double pixel_pitch_m) {
  const double cut_off = pupil_diameter_m / (2 * wavelength_m * image_distance_m);
  // Rounding in D must not cost a whole step where the rule holds with equality.
  return std::max(2, static_cast<int>(std::ceil(4 * pixel_pitch_m * cut_off * (1 - 1e-12))));
}

double ZernikeNoll(int index, double rho, double phi_rad) {
  assert(index >= 1);
  int n = 0;
  int left = index - 1;
  while (left > n) {
    ++n;
    left -= n;
  }
  // Within order n, |m| comes in pairs; even indices are cosines.
  const int m = n % 2 == 0 ? 2 * ((left + 1) / 2) : 2 * (left / 2) + 1;
  const auto factorial = [](int k) { return std::tgamma(k + 1.0); };
  double radial = 0;
  for (int k = 0; k <= (n - m) / 2; ++k) {
    radial += (k % 2 == 0 ? 1 : -1) * factorial(n - k) /
              (factorial(k) * factorial((n + m) / 2 - k) * factorial((n - m) / 2 - k)) *
              std::pow(rho, n - 2 * k);
  }
  if (m == 0) return std::sqrt(n + 1.0) * radial;
  const double angular = index % 2 == 0 ? std::cos(m * phi_rad) : std::sin(m * phi_rad);
  return std::sqrt(2 * (n + 1.0)) * radial * angular;
}

}  // namespace sightline
