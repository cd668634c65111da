// SPDX-License-Identifier: Apache-2.0
// Makes scans of a domain that aim at a place of the surface.
#pragma once

#include <Eigen/Core>
#include <array>

#include "core/inspection/inspection.h"
#include "core/rig/measurement.h"
#include "core/rig/rig.h"
#include "core/rig/scan_geometry.h"

namespace sightline {

// A scan that aims at a place, as a point of the unit cube. Coordinates: camera distance,
// triangulation angle, azimuth, polar angle, the part's three angles (resting orientations use
// alpha's), and the wanted image position of the place along the laser line and along the sheet.
inline constexpr int kAimDimensions = 9;
using Aim = std::array<double, kAimDimensions>;

// Point `index` of a low-discrepancy sequence in the cube: additive recurrence with the powers of
// the generalised golden ratio (Roberts 2018). It needs no number of points in advance.
Aim SpreadAim(int index);

// An aim before the place is known: all offsets are 0.
struct AimedScan {
  Measurement measurement;
  ScanGeometry geometry;
  // World position at which the place shall be lit, on the laser sheet.
  Eigen::Vector3d wanted_m;
};

AimedScan MakeAimedScan(const Rig& rig, const MeasurementDomain& domain, const Aim& aim);

// The same scan with offsets that bring the place (part coordinates) as near to the wanted position
// as the domain allows. `stage_m`: stage position that lights the place; not finite if none does.
struct ScanOfPlace {
  Measurement measurement;
  double stage_m = 0;
  // From the place to camera and laser, world axes, when it is lit.
  Eigen::Vector3d to_camera_m, to_laser_m;
};

ScanOfPlace AimAt(const AimedScan& scan, const MeasurementDomain& domain,
                  const Eigen::Vector3d& part_centre_m, const Eigen::Vector3d& place_m);

}  // namespace sightline
