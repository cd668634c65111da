// SPDX-License-Identifier: Apache-2.0
// Decides, by the table of the material, if a permitted exposure shows the laser line at a place of
// the part (core/detectability/detectability.h).
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/detectability/detectability.h"
#include "core/part/mesh.h"

namespace sightline {

enum class LightVerdict : uint8_t { kDetected, kTooDark, kTooBright };

struct LightOfPlace {
  LightVerdict verdict = LightVerdict::kDetected;
  // kTooDark: shortest exposure that shows the line, or infinite. kTooBright: longest one.
  double exposure_time_s = 0;
};

class LightLimit {
 public:
  // Entry of surfaces whose material has no table: light does not limit them.
  static constexpr int16_t kUnlimited = -1;

  // `detectability` has tables and both exposure times. A material of the part without a table of
  // its own uses the table without a name, if there is one.
  LightLimit(const Detectability& detectability, const TriangleMesh& part);

  // Number of the table of a triangle's material.
  int16_t EntryOf(size_t triangle) const {
    return entry_of_material_[triangle_material_.empty() ? 0 : triangle_material_[triangle]];
  }

  // `normal` of any length; the vectors lead from the place to camera and laser [m].
  LightOfPlace At(int16_t entry, const Eigen::Vector3d& normal, const Eigen::Vector3d& to_camera_m,
                  const Eigen::Vector3d& to_laser_m) const;
  // The same from distances and cosines (ExposureTable::At).
  LightOfPlace At(int16_t entry, double camera_distance_m, double laser_distance_m,
                  double cos_camera, double cos_laser, double cos_between) const;

  const std::vector<ExposureTable>& tables() const { return tables_; }
  double shortest_s() const { return shortest_s_; }
  double longest_s() const { return longest_s_; }

 private:
  std::vector<ExposureTable> tables_;
  double shortest_s_, longest_s_;  // permitted
  std::vector<uint16_t> triangle_material_;
  std::vector<int16_t> entry_of_material_;
};

}  // namespace sightline
