// SPDX-License-Identifier: Apache-2.0
// Converts a part with its surroundings from the inspection to the scene of light transport.
#pragma once

#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/inspection/inspection.h"
#include "core/part/mesh.h"
#include "core/rig/scan_geometry.h"
#include "render_worker/light_transport/light_transport.h"
#include "render_worker/material/material.h"

namespace sightline {

struct PartSceneInput {
  Inspection inspection;
  TriangleMesh part;
  std::vector<TriangleMesh> obstacles;  // in the order of inspection.obstacles
  AssetResolver assets;
};

class PartScene {
 public:
  // Reads materials and spectra. INVALID_ARGUMENT: a surface without a material, a material
  // assigned to no surface, a material or spectrum out of range; NOT_FOUND: a missing file.
  static absl::StatusOr<std::unique_ptr<PartScene>> Make(PartSceneInput input);

  const Inspection& inspection() const { return input_.inspection; }
  const Eigen::Vector3d& part_centre_m() const { return part_centre_m_; }
  // Bounding box of the part and the obstacles that move with it, in part coordinates.
  const Eigen::AlignedBox3d& part_box() const { return part_box_; }
  bool has_incoherent_light() const { return has_incoherent_light_; }
  // Sum of the lights' radiances, to compute mean wavelengths.
  Spectrum LightSpectrum() const;
  const std::vector<std::shared_ptr<const Material>>& materials() const { return materials_; }
  const std::vector<std::string>& material_names() const { return material_names_; }

  // Light transport at a stage position; rebuilt only if some object is fixed in the world.
  // Thread-safe.
  absl::StatusOr<std::shared_ptr<const LightTransport>> TransportAt(const Measurement& measurement,
                                                                    double stage_position_m);

 private:
  explicit PartScene(PartSceneInput input);
  absl::Status Prepare();

  PartSceneInput input_;
  Eigen::Vector3d part_centre_m_ = Eigen::Vector3d::Zero();
  Eigen::AlignedBox3d part_box_;
  std::vector<std::shared_ptr<const Material>> materials_;  // the last one is for obstacles
  std::vector<std::string> material_names_;
  std::vector<uint16_t> triangle_material_;
  Spectrum ambient_ = {};
  std::vector<Spectrum> area_light_spectra_;
  bool has_incoherent_light_ = false;
  std::mutex mutex_;
  std::vector<double> built_for_;
  std::shared_ptr<const LightTransport> transport_;
};

}  // namespace sightline
