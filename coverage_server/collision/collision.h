// SPDX-License-Identifier: Apache-2.0
// Hard constraints of a scan: nothing may touch along the travel that is used (thesis
// section 2.4.2, "death penalty").
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/inspection/inspection.h"
#include "core/rig/rig.h"
#include "core/rig/scan_geometry.h"
#include "coverage_server/occlusion/triangle_bvh.h"

namespace sightline {

// A mesh that may be hit and that occludes, in the frame it is given in.
struct Occluder {
  ObstacleFrame frame;
  TriangleBvh bvh;
};

// True if the bodies of camera and laser stand in the same place, or if, while the stage moves over
// [stage_start_m, stage_end_m], one of them touches an occluder or comes nearer to it than
// Rig::clearance_m, or the part (`occluders[0]`) or a
// fixture that moves with it touches one that stands still. Obstacles that travel with the stage
// without turning carry the part: they may touch it, but not cut into it by more than 0.2 % of its
// size. Exact for boxes: the body swept along the travel is a zonotope, and zonotope against
// triangle is decided by separating axes (differs from the projection on yz that the design first
// proposed: no grid, no resolution). Cylinders are enclosed in 8-sided prisms.
bool Collides(const Rig& rig, const ScanGeometry& geometry, const Eigen::Vector3d& part_centre_m,
              const std::vector<Occluder>& occluders, double stage_start_m, double stage_end_m);

}  // namespace sightline
