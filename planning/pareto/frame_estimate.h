// SPDX-License-Identifier: Apache-2.0
// Fast estimate of the frames of a scan that yield points, from the geometry of rig and part alone.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "core/rig/rig.h"
#include "core/targets/target_set.h"
#include "planning/pareto/plan_time.h"

namespace sightline {

// Evaluates a subset of the targets without occlusion: a target counts if it faces camera and laser
// and lies in the camera's field of view and range. Searches over thousands of scans use it;
// reported numbers come from exact frames.
class FrameEstimate {
 public:
  // `part_centre_m`: centre of the part's bounding box. At most about `most` targets are used.
  FrameEstimate(const Rig& rig, const Eigen::Vector3d& part_centre_m, const TargetSet& targets,
                size_t most = 1500);

  FrameRange Frames(const Measurement& scan) const;

 private:
  Rig rig_;
  Eigen::Vector3d part_centre_m_;
  std::vector<Eigen::Vector3d> positions_m_, normals_;  // part coordinates
};

}  // namespace sightline
