// SPDX-License-Identifier: Apache-2.0
// Measured points of a scan, frame by frame (the thesis's definition, sections 3.2 and 4.5).
//
// Frame k is taken at stage position k * scan_step. A rendered frame shows the laser line where the
// sheet cuts the part; in image column j the line's sub-pixel position lies on the plane through
// the camera and the column's centre. So the measurement points of a frame are the points of the
// mesh on the sheet and on a column plane that the laser lights and the camera sees. They are
// computed directly, without a frame buffer: the cut is exact, and segments to laser and camera
// decide occlusion. tests/coverage_server compares the points with those of a renderer.
#pragma once

#include <atomic>
#include <vector>

#include "core/part/mesh.h"
#include "core/rig/scan_geometry.h"
#include "coverage_server/answers/scene_answers.h"
#include "coverage_server/collision/collision.h"
#include "coverage_server/detectability/light_limit.h"
#include "coverage_server/scan/measured_scans.h"
#include "coverage_server/scan/scan_in_part.h"

namespace sightline {

// All measured points in order of frame, column, depth. `occluders[0]` is the part. Points lie on
// triangles that face both camera and laser; with `light`, only places count at which a permitted
// exposure shows the line. Empty if the sheet contains the scan direction. Stops early when
// *cancelled.
std::vector<MeasurementPoint> MeasureScan(const TriangleMesh& part, const Rig& rig,
                                          const Eigen::Vector3d& part_centre_m,
                                          const std::vector<Occluder>& occluders,
                                          const ScanGeometry& geometry, const PointLimits& depth,
                                          const std::atomic<bool>* cancelled,
                                          const LightLimit* light = nullptr);

inline std::vector<MeasurementPoint> MeasureScan(const TriangleMesh& part, const Rig& rig,
                                                 const Eigen::Vector3d& part_centre_m,
                                                 const std::vector<Occluder>& occluders,
                                                 const Measurement& measurement,
                                                 const PointLimits& depth,
                                                 const std::atomic<bool>* cancelled,
                                                 const LightLimit* light = nullptr) {
  return MeasureScan(part, rig, part_centre_m, occluders, MakeScanGeometry(rig, measurement), depth,
                     cancelled, light);
}

}  // namespace sightline
