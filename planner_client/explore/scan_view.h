// SPDX-License-Identifier: Apache-2.0
// Data for the 3-D view of a scan: poses of camera and laser, and their path.
#pragma once

#include <Eigen/Geometry>
#include <nlohmann/json.hpp>

#include "core/rig/measurement.h"
#include "core/rig/rig.h"

namespace sightline {

struct StageTravel {
  double start_m = 0, end_m = 0;
  double length_m() const { return end_m - start_m; }
};

// Stage positions between which the laser sheet crosses the part's bounding box; this contains all
// frames. 0 to 0 if the sheet contains the scan direction.
StageTravel TravelThroughBox(const Rig& rig, const Eigen::AlignedBox3d& part_box_m,
                             const Measurement& measurement);

// A scan as report/viewer/scene.js takes it: part coordinates, metres, row-major 4x4 matrices.
nlohmann::json ScanView(const Rig& rig, const Eigen::Vector3d& part_centre_m,
                        const Measurement& measurement, const StageTravel& travel);

}  // namespace sightline
