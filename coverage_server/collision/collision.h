// SPDX-License-Identifier: Apache-2.0
// Hard constraint of a scan: no collision along the travel that is used (thesis section 2.4.2,
// "death penalty").
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/inspection/inspection.h"
#include "core/rig/rig.h"
#include "core/rig/scan_geometry.h"
#include "coverage_server/occlusion/triangle_bvh.h"

namespace sightline {

// A mesh that can be hit and that occludes, in the coordinates of its own frame.
struct Occluder {
  ObstacleFrame frame;
  TriangleBvh bvh;
};

// True if the bodies of camera and laser overlap, or if one of the following happens while the
// stage moves over [stage_start_m, stage_end_m]: a body touches an occluder or comes nearer to it
// than Rig::clearance_m; the part (`occluders[0]`) or a fixture that moves with it touches an
// occluder that stands still. Obstacles that travel with the stage without turning carry the part:
// they may touch it, but not cut into it by more than 0.2 % of its size. Exact for boxes: the body
// swept along the travel is a zonotope, and separating axes decide zonotope against triangle (no
// grid, no resolution). Cylinders are enclosed in
// 8-sided prisms.
bool Collides(const Rig& rig, const ScanGeometry& geometry, const Eigen::Vector3d& part_centre_m,
              const std::vector<Occluder>& occluders, double stage_start_m, double stage_end_m);

}  // namespace sightline
