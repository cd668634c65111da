// SPDX-License-Identifier: Apache-2.0
// calibration.json, and the calibrated scanner as an inspection.
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "core/calibration_set/calibration_set.h"
#include "report/calibration/calibration_result.h"
#include "sightline/v1/inspection.pb.h"

namespace sightline {

// Text of calibration.json. Lengths in m, rotation vectors in rad; covariances row by row:
// laser_plane of its normal over its distance (x, y, z) [1/m]; hand_eye of rotation vector and
// translation; camera of fx, fy, cx, cy, k1, k2, p1, p2, k3.
std::string CalibrationJson(const CalibrationResult& result);

// The scanner with its uncertainty, and the part. `part_file`: as the inspection names it; empty:
// target.stl. Values that the images do not determine are taken from `set.assumed`.
v1::Inspection CalibratedInspection(const CalibrationResult& result, const CalibrationSet& set,
                                    const std::string& part_file);

// The target as a plate of 2 mm with one square of margin around the outer squares: ASCII STL in m.
std::string TargetStl(const TargetBoard& board);

}  // namespace sightline
