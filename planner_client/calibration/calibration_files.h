// SPDX-License-Identifier: Apache-2.0
// Writes calibration.json, and the calibrated scanner as an inspection.
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "core/calibration_set/calibration_set.h"
#include "report/calibration/calibration_result.h"
#include "sightline/v1/inspection.pb.h"

namespace sightline {

// Text of calibration.json. Lengths in m, rotation vectors in rad. Covariances are row-major:
// laser_plane for normal / distance (x, y, z) [1/m]; hand_eye for rotation vector, translation;
// camera for fx, fy, cx, cy, k1, k2, p1, p2, k3.
std::string CalibrationJson(const CalibrationResult& result);

// The scanner with its uncertainty, and the part. `part_file`: name in the inspection; if empty,
// target.stl. Values that the images do not determine are copied from `set.assumed`.
v1::Inspection CalibratedInspection(const CalibrationResult& result, const CalibrationSet& set,
                                    const std::string& part_file);

// The target as a 2 mm plate with a margin of one square around the outer squares: ASCII STL in m.
std::string TargetStl(const TargetBoard& board);

}  // namespace sightline
