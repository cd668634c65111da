// SPDX-License-Identifier: Apache-2.0
// A scanner before an artefact, with few columns so that tests are quick.
#pragma once

#include "core/acceptance/artefact_scan.h"
#include "core/physics/angle.h"
#include "core/rig/scan_geometry.h"

namespace sightline {

struct ArtefactSetting {
  Rig rig;
  ScanGeometry geometry;
  SightLimits limits;
};

// Camera distance 0.4 m, triangulation angle 30 degrees.
inline ArtefactSetting MakeArtefactSetting(double camera_polar_rad, int most_points) {
  ArtefactSetting s;
  s.rig.camera.columns_px = 640;
  s.rig.camera.rows_px = 512;
  s.rig.camera.vertical_fov_rad = 19 * kRadPerDeg;
  Measurement place;
  place.camera_distance_m = 0.4;
  place.triangulation_angle_rad = 30 * kRadPerDeg;
  place.camera_polar_rad = camera_polar_rad;
  s.geometry = MakeScanGeometry(s.rig, place);
  s.limits.most_points = most_points;
  return s;
}

}  // namespace sightline
