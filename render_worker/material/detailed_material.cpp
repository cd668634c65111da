// SPDX-License-Identifier: Apache-2.0
#include "render_worker/material/detailed_material.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace sightline {

using Eigen::Matrix3f;
using Eigen::Vector3f;

namespace {

// Cosines below this count as below the surface: formulas divide by them.
constexpr float kLeastCosine = 1e-5F;

bool Above(const Vector3f& out, const Vector3f& in) {
  return out.z() > kLeastCosine && in.z() > kLeastCosine;
}

bool Tilted(const SurfaceDetail& detail) {
  return detail.normal.x() != 0 || detail.normal.y() != 0;
}

Matrix3f TiltedFrame(const SurfaceDetail& detail) {
  return LocalFrame(detail.normal, Vector3f::UnitX());
}

}  // namespace

Matrix3f LocalFrame(const Vector3f& normal, const Vector3f& machining_direction) {
  Vector3f x = machining_direction - normal * normal.dot(machining_direction);
  const float length2 = x.squaredNorm();
  if (length2 > 1e-8F * machining_direction.squaredNorm() && length2 > 0) {
    x /= std::sqrt(length2);
  } else {
    // Duff et al., JCGT 2017.
    const float sign = std::copysign(1.0F, normal.z());
    const float a = -1 / (sign + normal.z());
    x = Vector3f(1 + sign * normal.x() * normal.x() * a, sign * normal.x() * normal.y() * a,
                 -sign * normal.x());
  }
  Matrix3f frame;
  frame.col(0) = x;
  frame.col(1) = normal.cross(x);
  frame.col(2) = normal;
  return frame;
}

float DetailedMaterial::Brdf(const Vector3f& out, const Vector3f& in,
                             const SurfaceDetail& detail) const {
  if (!Above(out, in)) return 0;
  const Scales scales{detail.albedo_scale, detail.roughness_scale};
  if (!Tilted(detail)) return FlatBrdf(out, in, scales);
  const Matrix3f frame = TiltedFrame(detail);
  const Vector3f tilted_out = frame.transpose() * out;
  const Vector3f tilted_in = frame.transpose() * in;
  if (!Above(tilted_out, tilted_in)) return 0;
  return FlatBrdf(tilted_out, tilted_in, scales) * (tilted_in.z() / in.z());
}

void DetailedMaterial::BrdfSpectrum(const Vector3f& out, const Vector3f& in,
                                    const SurfaceDetail& detail, Spectrum& brdf) const {
  brdf.fill(0);
  if (!Above(out, in)) return;
  const Scales scales{detail.albedo_scale, detail.roughness_scale};
  if (!Tilted(detail)) {
    FlatSpectrum(out, in, scales, brdf);
    return;
  }
  const Matrix3f frame = TiltedFrame(detail);
  const Vector3f tilted_out = frame.transpose() * out;
  const Vector3f tilted_in = frame.transpose() * in;
  if (!Above(tilted_out, tilted_in)) return;
  FlatSpectrum(tilted_out, tilted_in, scales, brdf);
  const float factor = tilted_in.z() / in.z();
  for (float& value : brdf) value *= factor;
}

Material::Sample DetailedMaterial::SampleDirection(const Vector3f& out, const SurfaceDetail& detail,
                                                   float u1, float u2, float u3) const {
  Sample sample;
  if (out.z() <= kLeastCosine) return sample;
  const Scales scales{detail.albedo_scale, detail.roughness_scale};
  if (!Tilted(detail)) {
    sample.in = FlatSample(out, scales, u1, u2, u3);
    if (sample.in.z() > kLeastCosine) sample.pdf = FlatPdf(out, sample.in, scales);
    return sample;
  }
  const Matrix3f frame = TiltedFrame(detail);
  const Vector3f tilted_out = frame.transpose() * out;
  if (tilted_out.z() <= kLeastCosine) return sample;
  const Vector3f tilted_in = FlatSample(tilted_out, scales, u1, u2, u3);
  sample.in = frame * tilted_in;
  // By Pdf itself, so that the two agree to the last bit.
  sample.pdf = Pdf(out, sample.in, detail);
  return sample;
}

float DetailedMaterial::Pdf(const Vector3f& out, const Vector3f& in,
                            const SurfaceDetail& detail) const {
  if (!Above(out, in)) return 0;
  const Scales scales{detail.albedo_scale, detail.roughness_scale};
  if (!Tilted(detail)) return FlatPdf(out, in, scales);
  const Matrix3f frame = TiltedFrame(detail);
  const Vector3f tilted_out = frame.transpose() * out;
  const Vector3f tilted_in = frame.transpose() * in;
  return Above(tilted_out, tilted_in) ? FlatPdf(tilted_out, tilted_in, scales) : 0;
}

SurfaceDetail DetailedMaterial::DetailAt(const Vector3f& position_m, const Vector3f& normal,
                                         float footprint_m) const {
  SurfaceDetail detail;
  if (common_.height_field == nullptr) return detail;
  int axis = 0;
  normal.cwiseAbs().maxCoeff(&axis);
  const int u_axis = axis == 0 ? 1 : 0;
  const int v_axis = axis == 2 ? 1 : 2;
  const HeightField::Patch patch =
      common_.height_field->At(position_m[u_axis], position_m[v_axis], footprint_m);

  Vector3f gradient = Vector3f::Zero();
  gradient[u_axis] = patch.slope_u * common_.normal_strength;
  gradient[v_axis] = patch.slope_v * common_.normal_strength;
  gradient -= normal * normal.dot(gradient);
  detail.normal =
      (LocalFrame(normal, common_.machining_direction).transpose() * (normal - gradient))
          .normalized();
  detail.albedo_scale = std::max(0.0F, 1 + common_.albedo_contrast * patch.relative_height);
  float roughness2 = 1 + common_.roughness_contrast * patch.relative_height;
  roughness2 = std::max(0.25F, roughness2 * std::abs(roughness2));
  if (RoughnessSquared() > 0) {
    // Slopes the footprint averages over widen the lobe, alpha^2 = 2 sigma^2 an axis (Olano and
    // Baker, I3D 2010).
    roughness2 += common_.normal_strength * common_.normal_strength * patch.lost_slope_variance /
                  RoughnessSquared();
  }
  detail.roughness_scale = std::sqrt(roughness2);
  return detail;
}

std::optional<double> DetailedMaterial::measured_scale_m() const {
  if (common_.height_field == nullptr) return std::nullopt;
  return common_.height_field->sample_pitch_m();
}

}  // namespace sightline
