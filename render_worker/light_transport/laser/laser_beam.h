// SPDX-License-Identifier: Apache-2.0
// The laser line projector's light: a Gaussian beam spread into a fan (thesis eq. 5.1-5.4).
#pragma once

#include <Eigen/Core>

#include "core/rig/rig.h"
#include "core/rig/scan_geometry.h"

namespace sightline {

// Half width of the rendered beam across the sheet in units of w: |q| <= 3 w contains all but 2e-9
// of the power.
inline constexpr double kBeamWidths = 3;

// In the sensor frame of the laser a point is (x, q, z): x along the line, q across the sheet, z
// along the fan's axis. With t = x/z the light spreads over the fan so that the power per dt is
//   Powell:   P / (2 T), |t| <= T = tan(fan/2)
//   Gaussian: P sqrt(2/pi)/T exp(-2 t^2/T^2)          (1/e^2 at the ends of the fan)
// As dt = dphi/cos^2(phi), Powell's power per fan angle is P/(2 T cos^2 phi): with the distance
// z/cos(phi) and the cosine of incidence cos(phi) a plate perpendicular to the axis at distance d
// receives P/(2 d T) per length, the uniform line of length L = 2 d T in the recordings' model.
// Across the sheet the profile is sqrt(2/pi)/w exp(-2 q^2/w^2), w = w(z) at the axial distance as
// in that model. The irradiance perpendicular to the ray follows as
//   I = (dP/dt) / (z cos phi) * sqrt(2/pi)/w(z) exp(-2 q^2/w^2),
// since the area of dt dq perpendicular to the ray is z cos(phi) dt dq. On the axis this is
// eq. 5.4.
class LaserBeam {
 public:
  LaserBeam(const Laser& laser, const SensorPose& pose);

  double power_w() const { return power_w_; }
  // 1/e^2 half width w(z) [m] with w_0 = M^2 lambda / (pi divergence) (eq. 5.2, M^2 = 1).
  double Radius_m(double z_m) const;

  struct Coordinates {
    double t = 0;  // tangent of the fan angle, x/z
    double q_m = 0;
    double z_m = 0;
  };
  Coordinates CoordinatesOf(const Eigen::Vector3d& point_m) const;
  // False outside the fan, behind the source and more than `widths` w away from the sheet; such
  // light is neglected.
  bool Reaches(const Coordinates& c, double widths) const;

  // Direction of travel at a point, unit vector (the slight divergence across the sheet is
  // neglected).
  Eigen::Vector3d Direction(const Coordinates& c) const;
  // Origin in the source of the light at a point, for shadow rays: the same relative position in
  // the beam's profile.
  Eigen::Vector3d SourcePoint(const Coordinates& c) const;

  // Irradiance perpendicular to the ray [W/m^2].
  double Irradiance_w_m2(const Coordinates& c) const;
  // Its mean over a footprint, a parallelogram around the point that extends by +- (a + b)/2 across
  // the sheet. The integral of the Gaussian is exact, so a line thinner than the footprint keeps
  // its power.
  double MeanIrradiance_w_m2(const Coordinates& c, double a_m, double b_m) const;

  // Samples a ray's position t in the fan in proportion to power, u in [0, 1).
  double SampleT(double u) const;
  // Point of the ray (t, q = s w(z)) at axial distance z.
  Eigen::Vector3d PointAt(double t, double s, double z_m) const;

  const SensorPose& pose() const { return pose_; }

 private:
  double PowerPerT_w(double t) const;

  SensorPose pose_;
  LineProfile profile_;
  double power_w_, tangent_, waist_m_, divergence_rad_, waist_distance_m_;
};

}  // namespace sightline
