// SPDX-License-Identifier: Apache-2.0
// Decides if a scan measures a place of the surface in the frame that lights it.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/inspection/inspection.h"
#include "core/rig/measurement.h"
#include "core/rig/rig.h"
#include "core/targets/target_set.h"
#include "coverage_server/collision/collision.h"
#include "coverage_server/detectability/light_limit.h"

namespace sightline {

// Checks the conditions of the exact evaluation at one place: limits on incidence, footprint, depth
// per pixel, defocus, image, fan and range; an exposure that shows the line; free segments to both
// sensors, past the part and obstacles that travel with the stage; bodies that do not touch one
// another and keep Rig::clearance_m to the table. Offsets are not limited, and obstacles that stand
// still are not considered.
class PlaceMeasurement {
 public:
  // `occluders` and `light` must outlive it. `table`: the occluder that must not be touched; may be
  // null. `light`: null if light limits nothing.
  PlaceMeasurement(const Rig& rig, const TargetSampling& sampling,
                   const Eigen::Vector3d& part_centre_m, const std::vector<Occluder>& occluders,
                   const Occluder* table, const LightLimit* light);

  // True if the scan measures `place_m` (part coordinates, unit normal `normal`) when the offsets
  // bring it to `lit_at_m`, a point of the laser sheet in world coordinates with the stage at 0.
  // `table_height_m` as in ScanGeometry. `light_entry`: LightLimit::EntryOf the place's triangle.
  // The offsets of `measurement` are not read.
  bool Measures(const Measurement& measurement, double table_height_m,
                const Eigen::Vector3d& place_m, const Eigen::Vector3d& normal, int16_t light_entry,
                const Eigen::Vector3d& lit_at_m) const;

 private:
  bool TouchesTable(const ScanGeometry& geometry) const;

  Rig rig_;  // without support points: the caller knows the height of the table
  TargetSampling sampling_;
  Eigen::Vector3d part_centre_m_;
  const std::vector<Occluder>& occluders_;
  const Occluder* table_;
  const LightLimit* light_;
};

}  // namespace sightline
