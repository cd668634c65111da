// SPDX-License-Identifier: Apache-2.0
#include "tests/render_worker/light_transport/test_scenes.h"

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

namespace sightline {
namespace {

class LambertMaterial : public Material {
 public:
  LambertMaterial(double albedo, bool grey) : albedo_(static_cast<float>(albedo)), grey_(grey) {}

  float Brdf(const Eigen::Vector3f& out, const Eigen::Vector3f& in,
             const SurfaceDetail&) const override {
    return out.z() > 0 && in.z() > 0 ? albedo_ * std::numbers::inv_pi_v<float> : 0;
  }
  void BrdfSpectrum(const Eigen::Vector3f& out, const Eigen::Vector3f& in,
                    const SurfaceDetail& detail, Spectrum& brdf) const override {
    const float f = Brdf(out, in, detail);
    for (int b = 0; b < kSpectralBins; ++b) {
      brdf[b] = grey_ ? f : f * static_cast<float>(b + 1) / kSpectralBins;
    }
  }
  bool grey() const override { return grey_; }
  Sample SampleDirection(const Eigen::Vector3f& out, const SurfaceDetail& detail, float u1,
                         float u2, float) const override {
    const float r = std::sqrt(u1), angle = 2 * std::numbers::pi_v<float> * u2;
    Sample sample;
    sample.in = {r * std::cos(angle), r * std::sin(angle), std::sqrt(std::max(1 - u1, 0.0F))};
    sample.pdf = Pdf(out, sample.in, detail);
    return sample;
  }
  float Pdf(const Eigen::Vector3f& out, const Eigen::Vector3f& in,
            const SurfaceDetail&) const override {
    return out.z() > 0 && in.z() > 0 ? in.z() * std::numbers::inv_pi_v<float> : 0;
  }
  SurfaceDetail DetailAt(const Eigen::Vector3f&, const Eigen::Vector3f&, float) const override {
    return {};
  }
  bool has_detail() const override { return false; }

 private:
  float albedo_;
  bool grey_;
};

}  // namespace

std::shared_ptr<const Material> TestLambert(double albedo) {
  return std::make_shared<LambertMaterial>(albedo, true);
}
std::shared_ptr<const Material> TestColouredLambert(double albedo) {
  return std::make_shared<LambertMaterial>(albedo, false);
}

TriangleMesh Rectangle(const Eigen::Vector3d& centre, const Eigen::Vector3d& half_u,
                       const Eigen::Vector3d& half_v) {
  TriangleMesh mesh;
  for (const auto& [a, b] : {std::pair{-1, -1}, {1, -1}, {1, 1}, {-1, 1}}) {
    mesh.positions_m.push_back((centre + a * half_u + b * half_v).cast<float>());
  }
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  return mesh;
}

TriangleMesh InwardBox(const Eigen::Vector3d& centre, const Eigen::Vector3d& half) {
  TriangleMesh box;
  for (int axis = 0; axis < 3; ++axis) {
    for (const int side : {-1, 1}) {
      Eigen::Vector3d n = Eigen::Vector3d::Zero(), u = n, v = n;
      n[axis] = side * half[axis];
      u[(axis + 1) % 3] = half[(axis + 1) % 3];
      v[(axis + 2) % 3] = half[(axis + 2) % 3];
      if (side > 0) std::swap(u, v);
      const TriangleMesh face = Rectangle(centre + n, u, v);
      const auto first = static_cast<uint32_t>(box.positions_m.size());
      box.positions_m.insert(box.positions_m.end(), face.positions_m.begin(),
                             face.positions_m.end());
      for (const auto& t : face.triangles) {
        box.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
      }
    }
  }
  return box;
}

Spectrum EvenSpectrum(double total) {
  Spectrum spectrum;
  spectrum.fill(static_cast<float>(total / kSpectralBins));
  return spectrum;
}

SensorPose Look(const Eigen::Vector3d& origin, const Eigen::Vector3d& z, const Eigen::Vector3d& x) {
  SensorPose pose;
  pose.origin_m = origin;
  pose.z_axis = z.normalized();
  pose.x_axis = (x - pose.z_axis * pose.z_axis.dot(x)).normalized();
  pose.y_axis = pose.z_axis.cross(pose.x_axis);
  return pose;
}

SensorPose LookDown(const Eigen::Vector3d& origin) {
  return Look(origin, -Eigen::Vector3d::UnitZ(), Eigen::Vector3d::UnitX());
}

SubPixelGrid Grid(int columns, int rows, double pitch_m, int sub_pixels) {
  SubPixelGrid grid;
  grid.roi = {-columns / 2, -rows / 2, columns, rows};
  grid.sub_pixels = sub_pixels;
  grid.pixel_pitch_m = pitch_m;
  return grid;
}

}  // namespace sightline
