#include "render_worker/light_transport/laser_beam.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace sightline {
namespace {

constexpr double kRootTwo = std::numbers::sqrt2;

// Quantile function of the standard normal distribution (Acklam's rational approximation and one
// step of Halley's method: accurate to rounding).
double NormalQuantile(double p) {
  p = std::clamp(p, 1e-12, 1 - 1e-12);
  static constexpr double a[] = {-3.969683028665376e+01, 2.209460984245205e+02,
                                 -2.759285104469687e+02, 1.383577518672690e+02,
                                 -3.066479806614716e+01, 2.506628277459239e+00};
  static constexpr double b[] = {-5.447609879822406e+01, 1.615858368580409e+02,
                                 -1.556989798598866e+02, 6.680131188771972e+01,
                                 -1.328068155288572e+01};
  static constexpr double c[] = {-7.784894002430293e-03, -3.223964580411365e-01,
                                 -2.400758277161838e+00, -2.549732539343734e+00,
                                 4.374664141464968e+00,  2.938163982698783e+00};
  static constexpr double d[] = {7.784695709041462e-03, 3.224671290700398e-01,
                                 2.445134137142996e+00, 3.754408661907416e+00};
  const auto tail = [](double q) {
    return (((((c[0] * q + c[1]) * q + c[2]) * q + c[3]) * q + c[4]) * q + c[5]) /
           ((((d[0] * q + d[1]) * q + d[2]) * q + d[3]) * q + 1);
  };
  double x;
  if (p < 0.02425) {
    x = tail(std::sqrt(-2 * std::log(p)));
  } else if (p > 1 - 0.02425) {
    x = -tail(std::sqrt(-2 * std::log(1 - p)));
  } else {
    const double q = p - 0.5, r = q * q;
    x = (((((a[0] * r + a[1]) * r + a[2]) * r + a[3]) * r + a[4]) * r + a[5]) * q /
        (((((b[0] * r + b[1]) * r + b[2]) * r + b[3]) * r + b[4]) * r + 1);
  }
  const double e = 0.5 * std::erfc(-x / kRootTwo) - p;
  const double u = e * std::sqrt(2 * std::numbers::pi) * std::exp(x * x / 2);
  return x - u / (1 + x * u / 2);
}

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
