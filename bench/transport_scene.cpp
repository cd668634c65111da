// SPDX-License-Identifier: Apache-2.0
#include "bench/transport_scene.h"

#include <Eigen/Geometry>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <numbers>

#include "core/part/load_part.h"

namespace sightline::bench {
namespace {

[[noreturn]] void Fail(const absl::Status& status) {
  std::fprintf(stderr, "%s\n", status.ToString().c_str());
  std::exit(1);
}

SensorPose Look(const Eigen::Vector3d& origin, const Eigen::Vector3d& at) {
  SensorPose pose;
  pose.origin_m = origin;
  pose.z_axis = (at - origin).normalized();
  pose.x_axis = Eigen::Vector3d::UnitX();
  pose.x_axis = (pose.x_axis - pose.z_axis * pose.z_axis.dot(pose.x_axis)).normalized();
  pose.y_axis = pose.z_axis.cross(pose.x_axis);
  return pose;
}

std::shared_ptr<const Material> Metal(double albedo, double f0, double alpha) {
  v1::Material message;
  message.mutable_lambert_ggx()->set_diffuse_albedo(albedo);
  message.mutable_lambert_ggx()->set_specular_f0(f0);
  message.mutable_lambert_ggx()->set_ggx_alpha(alpha);
  auto material = MakeMaterial(message, 661e-9, nullptr, "bench");
  if (!material.ok()) Fail(material.status());
  return *std::move(material);
}

Spectrum Even(double total) {
  Spectrum spectrum;
  spectrum.fill(static_cast<float>(total / kSpectralBins));
  return spectrum;
}

}  // namespace

SubPixelGrid TransportScene::Crop(int column, int row, int columns, int rows,
                                  int sub_pixels) const {
  SubPixelGrid grid;
  grid.roi = {column - columns_px / 2, row - rows_px / 2, columns, rows};
  grid.sub_pixels = sub_pixels;
  grid.pixel_pitch_m = pixel_pitch_m;
  return grid;
}

SubPixelGrid TransportScene::Grid(int sub_pixels) const {
  return Crop(0, 0, columns_px, rows_px, sub_pixels);
}

TransportScene CylinderHeadScene(const std::string& glb) {
  TransportScene scene;
  auto part = LoadPart(glb, "");
  if (!part.ok()) Fail(part.status());
  SceneMesh head;
  head.mesh = *std::move(part);
  // Machined planes (the top one and the flanges) shine more than cast walls.
  for (size_t t = 0; t < head.mesh.triangles.size(); ++t) {
    const Eigen::Vector3d n = head.mesh.Normal(t);
    head.triangle_material.push_back(n.z() > 0.9999 || std::abs(n.y()) > 0.9999 ? 0 : 1);
  }
  scene.scene.meshes.push_back(std::move(head));
  scene.scene.materials = {Metal(0.35, 0.6, 0.4), Metal(0.45, 0.3, 0.6)};
  scene.scene.ambient_radiance_w_m2_sr = Even(0.05);
  // Faces down.
  scene.scene.area_lights = {{{0.3, -0.2, 1.1}, {0.4, 0, 0}, {0, -0.2, 0}, Even(0.5)}};

  const Eigen::Vector3d target(0.225, 0.03, 0.06);
  scene.view.camera = Look({0.225, -0.37, 0.31}, target);
  const double focal_length_m = 0.016, f_number = 11;
  scene.view.focus_distance_m = 0.46;
  scene.view.image_distance_m = 1 / (1 / focal_length_m - 1 / scene.view.focus_distance_m);
  scene.view.pupil_radius_m = focal_length_m / f_number / 2;
  scene.view.laser = Look({0.225, -0.36, 0.06}, {0.225, 0, 0.05});
  scene.view.laser_source.fan_angle_rad = 60 * std::numbers::pi / 180;
  return scene;
}

}  // namespace sightline::bench
