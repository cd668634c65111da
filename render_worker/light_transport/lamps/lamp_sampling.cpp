// SPDX-License-Identifier: Apache-2.0
#include "render_worker/light_transport/lamps/lamp_sampling.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace sightline {

SphericalRectangle::SphericalRectangle(const EmittingRectangle& rectangle,
                                       const Eigen::Vector3d& from_m)
    : origin_(from_m) {
  const double length_x = 2 * rectangle.half_edge_u_m.norm();
  const double length_y = 2 * rectangle.half_edge_v_m.norm();
  x_ = rectangle.half_edge_u_m * (2 / length_x);
  y_ = rectangle.half_edge_v_m * (2 / length_y);
  z_ = x_.cross(y_);
  const Eigen::Vector3d d =
      rectangle.centre_m - rectangle.half_edge_u_m - rectangle.half_edge_v_m - from_m;
  z0_ = d.dot(z_);
  if (z0_ > 0) {
    z_ = -z_;
    z0_ = -z0_;
  }
  x0_ = d.dot(x_);
  y0_ = d.dot(y_);
  x1_ = x0_ + length_x;
  y1_ = y0_ + length_y;
  const Eigen::Vector3d v00(x0_, y0_, z0_), v01(x0_, y1_, z0_), v10(x1_, y0_, z0_),
      v11(x1_, y1_, z0_);
  const Eigen::Vector3d n0 = v00.cross(v10).normalized(), n1 = v10.cross(v11).normalized(),
                        n2 = v11.cross(v01).normalized(), n3 = v01.cross(v00).normalized();
  const auto angle = [](const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
    return std::acos(std::clamp(-a.dot(b), -1.0, 1.0));
  };
  b0_ = n0.z();
  b1_ = n2.z();
  k_ = 2 * std::numbers::pi - angle(n2, n3) - angle(n3, n0);
  solid_angle_ = std::max(angle(n0, n1) + angle(n1, n2) - k_, 1e-12);
}

Eigen::Vector3d SphericalRectangle::Sample(double u1, double u2) const {
  const double au = u1 * solid_angle_ + k_;
  const double fu = (std::cos(au) * b0_ - b1_) / std::sin(au);
  double cu = std::copysign(1 / std::sqrt(fu * fu + b0_ * b0_), fu);
  cu = std::clamp(cu, -1.0, 1.0);
  const double xu = std::clamp(-(cu * z0_) / std::sqrt(std::max(1 - cu * cu, 1e-300)), x0_, x1_);
  const double d2 = xu * xu + z0_ * z0_;
  const double h0 = y0_ / std::sqrt(d2 + y0_ * y0_), h1 = y1_ / std::sqrt(d2 + y1_ * y1_);
  const double hv = h0 + u2 * (h1 - h0);
  const double yv = hv * hv < 1 - 1e-12 ? hv * std::sqrt(d2 / (1 - hv * hv)) : y1_;
  return origin_ + xu * x_ + yv * y_ + z0_ * z_;
}

LampChoice::LampChoice(const SceneDescription& description) : lamps_(description.area_lights) {
  for (const EmittingRectangle& lamp : lamps_) {
    const Eigen::Vector3d cross = lamp.half_edge_u_m.cross(lamp.half_edge_v_m);
    normals_.push_back(cross.normalized().cast<float>());
    centres_m_.push_back(lamp.centre_m.cast<float>());
    inverse_u_1_m_.push_back((lamp.half_edge_u_m / lamp.half_edge_u_m.squaredNorm()).cast<float>());
    inverse_v_1_m_.push_back((lamp.half_edge_v_m / lamp.half_edge_v_m.squaredNorm()).cast<float>());
    areas_m2_.push_back(static_cast<float>(4 * cross.norm()));
    float radiance = 0;
    for (const float value : lamp.radiance_w_m2_sr) radiance += value;
    powers_.push_back(radiance * areas_m2_.back());
  }
}

float LampChoice::Weight(const SurfacePoint& from, int lamp) const {
  const Eigen::Vector3f to = lamps_[lamp].centre_m.cast<float>() - from.position_m;
  if (to.dot(normals_[lamp]) >= 0) return 0;  // behind the lamp
  const float reach = std::abs(from.normal.dot(lamps_[lamp].half_edge_u_m.cast<float>())) +
                      std::abs(from.normal.dot(lamps_[lamp].half_edge_v_m.cast<float>()));
  if (to.dot(from.normal) + reach <= 0) return 0;  // below the horizon
  return powers_[lamp] / (to.squaredNorm() + areas_m2_[lamp]);
}

float LampChoice::TotalWeight(const SurfacePoint& from) const {
  float total = 0;
  for (int l = 0; l < static_cast<int>(lamps_.size()); ++l) total += Weight(from, l);
  return total;
}

LampChoice::Sample LampChoice::SampleLamp(const SurfacePoint& from, float u_choice, float u1,
                                          float u2) const {
  Sample sample;
  const float total = TotalWeight(from);
  if (!(total > 0)) return sample;
  float left = u_choice * total, weight = 0;
  for (int l = 0; l < static_cast<int>(lamps_.size()); ++l) {
    const float w = Weight(from, l);
    if (w <= 0) continue;
    sample.lamp = l;
    weight = w;
    if (left < w) break;
    left -= w;
  }
  const SphericalRectangle rectangle(lamps_[sample.lamp], from.position_m.cast<double>());
  sample.point_m = rectangle.Sample(u1, u2).cast<float>();
  sample.direction = (sample.point_m - from.position_m).normalized();
  sample.pdf = weight / total / static_cast<float>(rectangle.solid_angle_sr());
  return sample;
}

float LampChoice::Pdf(const SurfacePoint& from, int lamp) const {
  const float weight = Weight(from, lamp);
  if (weight <= 0) return 0;
  const SphericalRectangle rectangle(lamps_[lamp], from.position_m.cast<double>());
  return weight / TotalWeight(from) / static_cast<float>(rectangle.solid_angle_sr());
}

int LampChoice::Meet(const Eigen::Vector3f& from_m, const Eigen::Vector3f& direction,
                     Eigen::Vector3f& place_m) const {
  int nearest = -1;
  float distance = 0;
  for (int l = 0; l < static_cast<int>(lamps_.size()); ++l) {
    const float facing = direction.dot(normals_[l]);
    if (facing >= 0) continue;
    const float t = (centres_m_[l] - from_m).dot(normals_[l]) / facing;
    if (!(t > 0) || (nearest >= 0 && t >= distance)) continue;
    const Eigen::Vector3f place = from_m + t * direction;
    const Eigen::Vector3f offset = place - centres_m_[l];
    if (std::abs(offset.dot(inverse_u_1_m_[l])) > 1 ||
        std::abs(offset.dot(inverse_v_1_m_[l])) > 1) {
      continue;
    }
    nearest = l;
    distance = t;
    place_m = place;
  }
  return nearest;
}

}  // namespace sightline
