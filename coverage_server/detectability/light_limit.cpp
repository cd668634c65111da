// SPDX-License-Identifier: Apache-2.0
#include "coverage_server/detectability/light_limit.h"

#include <string>

namespace sightline {

LightLimit::LightLimit(const Detectability& detectability, const TriangleMesh& part)
    : shortest_s_(*detectability.min_exposure_time_s),
      longest_s_(*detectability.max_exposure_time_s),
      triangle_material_(part.triangle_material) {
  int16_t unnamed = kUnlimited;
  for (const MaterialExposures& material : detectability.materials) {
    if (material.part_material.empty()) unnamed = static_cast<int16_t>(tables_.size());
    tables_.emplace_back(material);
  }
  if (part.triangle_material.empty()) {
    entry_of_material_ = {unnamed};
    return;
  }
  for (const std::string& name : part.material_names) {
    int16_t entry = unnamed;
    for (size_t i = 0; i < detectability.materials.size(); ++i) {
      if (detectability.materials[i].part_material == name) entry = static_cast<int16_t>(i);
    }
    entry_of_material_.push_back(entry);
  }
}

LightOfPlace LightLimit::At(int16_t entry, double camera_distance_m, double laser_distance_m,
                            double cos_camera, double cos_laser, double cos_between) const {
  if (entry == kUnlimited) return {};
  const ExposureRange needed = tables_[static_cast<size_t>(entry)].At(
      camera_distance_m, laser_distance_m, cos_camera, cos_laser, cos_between);
  if (needed.shortest_s > longest_s_) return {LightVerdict::kTooDark, needed.shortest_s};
  if (needed.longest_s < shortest_s_) return {LightVerdict::kTooBright, needed.longest_s};
  return {};
}

LightOfPlace LightLimit::At(int16_t entry, const Eigen::Vector3d& normal,
                            const Eigen::Vector3d& to_camera_m,
                            const Eigen::Vector3d& to_laser_m) const {
  if (entry == kUnlimited) return {};
  const double camera_m = to_camera_m.norm(), laser_m = to_laser_m.norm(), length = normal.norm();
  return At(entry, camera_m, laser_m, normal.dot(to_camera_m) / (length * camera_m),
            normal.dot(to_laser_m) / (length * laser_m),
            to_camera_m.dot(to_laser_m) / (camera_m * laser_m));
}

}  // namespace sightline
