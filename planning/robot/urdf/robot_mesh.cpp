// SPDX-License-Identifier: Apache-2.0
#include "planning/robot/urdf/robot_mesh.h"

#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/part/load_part.h"

namespace sightline {
namespace {

struct MeshUnit {
  const char* name;
  double metres;
};
constexpr MeshUnit kMeshUnits[] = {
    {"m", 1}, {"inch", 0.0254}, {"cm", 1e-2}, {"mm", 1e-3}, {"um", 1e-6}};

// The unit nearest to the scale: LoadPart checks a part's size in metres, and this unit gives it
// nearly the true size.
const MeshUnit& NearestUnit(double scale) {
  const MeshUnit* nearest = kMeshUnits;
  const auto distance = [&](const MeshUnit& unit) {
    return std::abs(std::log(scale / unit.metres));
  };
  for (const MeshUnit& unit : kMeshUnits) {
    if (distance(unit) < distance(*nearest)) nearest = &unit;
  }
  return *nearest;
}

}  // namespace

absl::StatusOr<TriangleMesh> LoadRobotMesh(const std::string& path, const Eigen::Vector3d& scale) {
  constexpr double kSmallestM = 1e-3, kLargestM = 10;
  if (!scale.allFinite() || !(scale.cwiseAbs().minCoeff() > 0)) {
    return absl::InvalidArgumentError("mesh scale must be finite and not 0");
  }
  const std::string scale_text =
      absl::StrCat("with mesh scale \"", scale.x(), " ", scale.y(), " ", scale.z(), "\"");
  const MeshUnit& unit = NearestUnit(scale.cwiseAbs().maxCoeff());
  absl::StatusOr<TriangleMesh> mesh = LoadPart(path, unit.name, {}, "correct the scale of <mesh>");
  if (!mesh.ok()) {
    return absl::Status(mesh.status().code(),
                        absl::StrCat(mesh.status().message(), " (", scale_text, ")"));
  }
  const Eigen::Vector3d factor = scale / unit.metres;
  if (factor != Eigen::Vector3d::Ones()) {
    for (Eigen::Vector3f& p : mesh->positions_m) {
      // Adding zero turns -0 into 0, so that equal meshes have equal bytes for the digest.
      p = factor.cwiseProduct(p.cast<double>()).cast<float>() + Eigen::Vector3f::Zero();
    }
  }
  if (scale.prod() < 0) {
    for (auto& corners : mesh->triangles) std::swap(corners[1], corners[2]);
  }
  const double extent_m = mesh->BoundingBox().sizes().maxCoeff();
  if (!(extent_m >= kSmallestM && extent_m <= kLargestM)) {
    return absl::InvalidArgumentError(absl::StrCat(path, ": its largest extent is ", extent_m,
                                                   " m ", scale_text,
                                                   ", must be in [0.001, 10] m"));
  }
  return mesh;
}

}  // namespace sightline
