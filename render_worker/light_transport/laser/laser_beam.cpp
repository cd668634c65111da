// SPDX-License-Identifier: Apache-2.0
#include "render_worker/light_transport/laser/laser_beam.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/statistics/normal_distribution.h"

namespace sightline {
namespace {

constexpr double kRootTwo = std::numbers::sqrt2;

// Antiderivatives of the profile g(q) = sqrt(2/pi)/w exp(-2 q^2/w^2), whose integral is 1.
double FirstIntegral(double q, double w) { return 0.5 * std::erf(kRootTwo * q / w); }
double SecondIntegral(double q, double w) {
  return q * FirstIntegral(q, w) +
         w / (2 * std::sqrt(2 * std::numbers::pi)) * std::exp(-2 * q * q / (w * w));
}

}  // namespace

LaserBeam::LaserBeam(const Laser& laser, const SensorPose& pose)
    : pose_(pose),
      profile_(laser.line_profile),
      power_w_(laser.power_w),
      tangent_(std::tan(laser.fan_angle_rad / 2)),
      waist_m_(laser.beam_quality_m2 * laser.wavelength_m /
               (std::numbers::pi * laser.divergence_rad)),
      divergence_rad_(laser.divergence_rad),
      waist_distance_m_(laser.beam_focus_distance_m) {}

double LaserBeam::Radius_m(double z_m) const {
  return std::hypot(waist_m_, divergence_rad_ * (z_m - waist_distance_m_));
}

LaserBeam::Coordinates LaserBeam::CoordinatesOf(const Eigen::Vector3d& point_m) const {
  const Eigen::Vector3d r = point_m - pose_.origin_m;
  const double z = r.dot(pose_.z_axis);
  return {r.dot(pose_.x_axis) / z, r.dot(pose_.y_axis), z};
}

bool LaserBeam::Reaches(const Coordinates& c, double widths) const {
  if (!(c.z_m > 0)) return false;
  const double limit = profile_ == LineProfile::kPowell ? tangent_ : 2.5 * tangent_;
  return std::abs(c.t) <= limit && std::abs(c.q_m) <= widths * Radius_m(c.z_m);
}

Eigen::Vector3d LaserBeam::Direction(const Coordinates& c) const {
  return (c.t * pose_.x_axis + pose_.z_axis).normalized();
}

Eigen::Vector3d LaserBeam::SourcePoint(const Coordinates& c) const {
  return pose_.origin_m + c.q_m * Radius_m(0) / Radius_m(c.z_m) * pose_.y_axis;
}

double LaserBeam::PowerPerT_w(double t) const {
  if (profile_ == LineProfile::kPowell) return power_w_ / (2 * tangent_);
  return power_w_ * std::sqrt(2 / std::numbers::pi) / tangent_ *
         std::exp(-2 * t * t / (tangent_ * tangent_));
}

double LaserBeam::Irradiance_w_m2(const Coordinates& c) const {
  return MeanIrradiance_w_m2(c, 0, 0);
}

double LaserBeam::MeanIrradiance_w_m2(const Coordinates& c, double a_m, double b_m) const {
  const double w = Radius_m(c.z_m);
  double a = std::abs(a_m), b = std::abs(b_m);
  if (a < b) std::swap(a, b);
  double profile;  // mean of the profile over two boxes of widths a and b
  const double q = c.q_m;
  if (a < 1e-3 * w) {
    profile = std::sqrt(2 / std::numbers::pi) / w * std::exp(-2 * q * q / (w * w));
  } else if (b < 1e-3 * a || b < 1e-3 * w) {
    profile = (FirstIntegral(q + a / 2, w) - FirstIntegral(q - a / 2, w)) / a;
  } else {
    profile = (SecondIntegral(q + (a + b) / 2, w) - SecondIntegral(q + (a - b) / 2, w) -
               SecondIntegral(q - (a - b) / 2, w) + SecondIntegral(q - (a + b) / 2, w)) /
              (a * b);
  }
  return PowerPerT_w(c.t) / c.z_m * std::sqrt(1 + c.t * c.t) * std::max(profile, 0.0);
}

double LaserBeam::SampleT(double u) const {
  if (profile_ == LineProfile::kPowell) return tangent_ * (2 * u - 1);
  return tangent_ / 2 * NormalQuantile(u);
}

Eigen::Vector3d LaserBeam::PointAt(double t, double s, double z_m) const {
  return pose_.origin_m + z_m * (t * pose_.x_axis + pose_.z_axis) +
         s * Radius_m(z_m) * pose_.y_axis;
}

}  // namespace sightline
