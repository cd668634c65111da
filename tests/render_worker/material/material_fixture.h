// SPDX-License-Identifier: Apache-2.0
// Materials and directions for the tests of this folder.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <numbers>
#include <string>
#include <system_error>

#include "core/random/counter_random.h"
#include "render_worker/material/material.h"

namespace sightline {

// A folder of this process for files that tests write; removed at its end.
struct TestFolder {
  std::filesystem::path path;
  TestFolder() {
    std::string name = ::testing::TempDir() + "sightline_material_XXXXXX";
    path = mkdtemp(name.data());
  }
  ~TestFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path, ignored);
  }
};
inline std::string TestFile(const std::string& name) {
  static const TestFolder folder;
  return folder.path / name;
}

inline Eigen::Vector3f Direction(double theta_deg, double phi_deg) {
  const double theta = theta_deg * std::numbers::pi / 180;
  const double phi = phi_deg * std::numbers::pi / 180;
  return Eigen::Vector3d(std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi),
                         std::cos(theta))
      .cast<float>();
}

inline v1::Material LambertGgxMessage(double albedo, double f0, double alpha) {
  v1::Material message;
  message.mutable_lambert_ggx()->set_diffuse_albedo(albedo);
  message.mutable_lambert_ggx()->set_specular_f0(f0);
  message.mutable_lambert_ggx()->set_ggx_alpha(alpha);
  return message;
}

inline v1::Material ConductorMessage(double alpha_x, double alpha_y, double diffuse) {
  v1::Material message;
  v1::Material::Conductor* model = message.mutable_conductor();
  v1::Material::RefractiveIndex* index = model->add_refractive_index();
  index->set_wavelength_m(661e-9);
  index->set_n(1.47);
  index->set_k(7.6);
  model->set_ggx_alpha_x(alpha_x);
  model->set_ggx_alpha_y(alpha_y);
  model->mutable_machining_direction()->set_x(1);
  model->set_diffuse_albedo(diffuse);
  return message;
}

inline absl::StatusOr<std::string> SamePath(const std::string& file) { return file; }

inline std::shared_ptr<const Material> Make(const v1::Material& message) {
  absl::StatusOr<std::shared_ptr<const Material>> material =
      MakeMaterial(message, 661e-9, SamePath, "test");
  EXPECT_TRUE(material.ok()) << material.status();
  return material.ok() ? *material : nullptr;
}

}  // namespace sightline
