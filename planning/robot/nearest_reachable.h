// SPDX-License-Identifier: Apache-2.0
// The scan next to one that an arm cannot reach.
#pragma once

#include <atomic>
#include <functional>
#include <optional>
#include <string>

#include "core/inspection/inspection.h"
#include "planning/robot/robot_cell.h"

namespace sightline {

// Searches for a reachable scan of the domain near `measurement`. It tries random scans at growing
// distance, with each parameter scaled by its domain, then moves from the nearest of these back
// towards `measurement`. The result is reproducible. Nothing if none was found, or if interrupted.
std::optional<Measurement> NearestReachable(
    const RobotCell& cell, const MeasurementDomain& domain, const Measurement& measurement,
    const std::function<ScanTravel(const Measurement&)>& travel_of,
    const std::atomic<bool>* interrupted);

// The parameters in which a scan differs from another: "camera_polar_deg 41.20, offset_z_m 0.0350".
std::string DifferenceText(const Measurement& scan, const Measurement& other);

}  // namespace sightline
