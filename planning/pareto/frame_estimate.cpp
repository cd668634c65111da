// SPDX-License-Identifier: Apache-2.0
#include "planning/pareto/frame_estimate.h"

#include <cmath>
#include <limits>

#include "core/rig/scan_geometry.h"

namespace sightline {

FrameEstimate::FrameEstimate(const Rig& rig, const Eigen::Vector3d& part_centre_m,
                             const TargetSet& targets, size_t most)
    : rig_(rig), part_centre_m_(part_centre_m) {
  const size_t stride = targets.size() / most + 1;
  for (size_t t = 0; t < targets.size(); t += stride) {
    positions_m_.push_back(targets.positions_m[t].cast<double>());
    normals_.push_back(targets.normals[t].cast<double>());
  }
}

FrameRange FrameEstimate::Frames(const Measurement& scan) const {
  const ScanGeometry geometry = MakeScanGeometry(rig_, scan);
  const double tangent_y = std::tan(0.5 * rig_.camera.vertical_fov_rad);
  const double tangent_x = tangent_y * rig_.camera.columns_px / rig_.camera.rows_px;
  double low_m = std::numeric_limits<double>::infinity(), high_m = -low_m;
  for (size_t i = 0; i < positions_m_.size(); ++i) {
    Eigen::Vector3d x = PartToWorld(geometry, part_centre_m_, positions_m_[i], 0);
    const double stage_m = geometry.LitStagePosition(x);
    if (!std::isfinite(stage_m)) continue;
    x.x() += stage_m;  // its place when the laser lights it
    const Eigen::Vector3d normal = geometry.part_rotation * normals_[i];
    const Eigen::Vector3d to_camera = geometry.camera.origin_m - x;
    if (normal.dot(to_camera) <= 0 || normal.dot(geometry.laser.origin_m - x) <= 0) continue;
    const double depth_m = -to_camera.dot(geometry.camera.z_axis);
    if (depth_m <= 0 || to_camera.squaredNorm() > rig_.max_range_m * rig_.max_range_m ||
        std::abs(to_camera.dot(geometry.camera.x_axis)) > tangent_x * depth_m ||
        std::abs(to_camera.dot(geometry.camera.y_axis)) > tangent_y * depth_m) {
      continue;
    }
    low_m = std::min(low_m, stage_m);
    high_m = std::max(high_m, stage_m);
  }
  if (low_m > high_m || std::abs(low_m) > 1e3 || std::abs(high_m) > 1e3) return {};
  return {static_cast<int>(std::ceil(low_m / rig_.scan_step_m)),
          static_cast<int>(std::floor(high_m / rig_.scan_step_m))};
}

}  // namespace sightline
