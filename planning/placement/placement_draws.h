// SPDX-License-Identifier: Apache-2.0
// Simulated placements: poses of part, camera and laser in each scan of a plan when a person or a
// robot places them with errors.
//
// Errors are normal and independent along and about each axis. Scans made without moving the
// sensors share one error of the sensors; scans made without touching the part, one of the
// part. A robot approaches every scan anew. Camera and laser in one housing move as one
// body.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/inspection/inspection.h"
#include "core/rig/measurement.h"
#include "core/rig/scan_geometry.h"
#include "planning/strategy/execution/execution_model.h"

namespace sightline {

struct PlacementModel {
  PlacementErrors errors;
  Rig rig;
  ExecutionModel execution;
  // Camera and laser have one housing, or one robot holds both.
  bool rigid_head = false;
  // The part lies on a table that determines its tilt: it turns about the vertical only.
  bool on_table = false;
};

// The model of an inspection whose part is held (HoldPart).
PlacementModel PlacementModelOf(const Inspection& inspection);

class PlacementDraws {
 public:
  // `scans` in the order in which they are made.
  PlacementDraws(PlacementModel model, std::span<const Measurement> scans);

  // Displacements of all scans in the execution with this number.
  std::vector<ScanDisplacement> Draw(uint64_t seed, uint32_t execution) const;

  // Index behind the last scan of each group. Scans of different groups share no error.
  const std::vector<size_t>& group_ends() const { return group_ends_; }

 private:
  PlacementModel model_;
  std::vector<ScanGeometry> geometries_;
  std::vector<Placings> placings_;  // of each scan
  std::vector<size_t> group_ends_;
};

}  // namespace sightline
