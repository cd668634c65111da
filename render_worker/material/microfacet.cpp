// SPDX-License-Identifier: Apache-2.0
#include "render_worker/material/microfacet.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "render_worker/material/single_precision_pi.h"

namespace sightline {

using Eigen::Vector3f;

float GgxDistribution(const GgxRoughness& roughness, const Vector3f& half) {
  if (half.z() <= 0) return 0;
  const float x = half.x() / roughness.alpha_x;
  const float y = half.y() / roughness.alpha_y;
  const float stretched = x * x + y * y + half.z() * half.z();
  return 1 / (kPi * roughness.alpha_x * roughness.alpha_y * stretched * stretched);
}

float GgxLambda(const GgxRoughness& roughness, const Vector3f& direction) {
  const float x = roughness.alpha_x * direction.x();
  const float y = roughness.alpha_y * direction.y();
  const float slope2 = (x * x + y * y) / (direction.z() * direction.z());
  return 0.5F * (std::sqrt(1 + slope2) - 1);
}

float GgxMasking(const GgxRoughness& roughness, const Vector3f& direction) {
  return 1 / (1 + GgxLambda(roughness, direction));
}

float GgxMaskingShadowing(const GgxRoughness& roughness, const Vector3f& out, const Vector3f& in) {
  return 1 / (1 + (GgxLambda(roughness, out) + GgxLambda(roughness, in)));
}

float GgxReflection(const GgxRoughness& roughness, const Vector3f& out, const Vector3f& in) {
  const Vector3f half = (out + in).normalized();
  return GgxDistribution(roughness, half) * GgxMaskingShadowing(roughness, out, in) /
         (4 * (out.z() * in.z()));
}

Vector3f SampleVisibleNormal(const GgxRoughness& roughness, const Vector3f& out, float u1,
                             float u2) {
  const Vector3f view =
      Vector3f(roughness.alpha_x * out.x(), roughness.alpha_y * out.y(), out.z()).normalized();
  const float length2 = view.x() * view.x() + view.y() * view.y();
  const Vector3f t1 = length2 > 0 ? Vector3f(Vector3f(-view.y(), view.x(), 0) / std::sqrt(length2))
                                  : Vector3f::UnitX();
  const Vector3f t2 = view.cross(t1);
  const float radius = std::sqrt(u1);
  const float phi = 2 * kPi * u2;
  const float p1 = radius * std::cos(phi);
  const float mix = 0.5F * (1 + view.z());
  const float p2 =
      (1 - mix) * std::sqrt(std::max(0.0F, 1 - p1 * p1)) + mix * radius * std::sin(phi);
  const Vector3f normal =
      p1 * t1 + p2 * t2 + std::sqrt(std::max(0.0F, 1 - p1 * p1 - p2 * p2)) * view;
  return Vector3f(roughness.alpha_x * normal.x(), roughness.alpha_y * normal.y(),
                  std::max(1e-7F, normal.z()))
      .normalized();
}

float VisibleNormalReflectionPdf(const GgxRoughness& roughness, const Vector3f& out,
                                 const Vector3f& in) {
  const Vector3f half = (out + in).normalized();
  return GgxDistribution(roughness, half) * GgxMasking(roughness, out) / (4 * out.z());
}

Vector3f ReflectAt(const Vector3f& half, const Vector3f& out) {
  return (2 * out.dot(half) * half - out).normalized();
}

Vector3f SampleCosine(float u1, float u2) {
  const float radius = std::sqrt(u1);
  const float phi = 2 * kPi * u2;
  return {radius * std::cos(phi), radius * std::sin(phi), std::sqrt(std::max(0.0F, 1 - u1))};
}

}  // namespace sightline
