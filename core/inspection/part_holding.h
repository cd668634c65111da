// SPDX-License-Identifier: Apache-2.0
// Support of the part while it is scanned: a table it rests on, a fixture, or nothing.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/inspection/inspection.h"
#include "core/part/mesh.h"
#include "core/resting/resting_faces.h"

namespace sightline {

// Part of ParseInspection: rig.part_holding, its default and rig.table; a part in a fixture has
// alpha and beta fixed at 0. `inspection` has its domain. INVALID_ARGUMENT names fields that
// exclude each other.
absl::Status ParsePartHolding(const v1::Inspection& message, const std::string& context,
                              Inspection* inspection);

// A resting face that plans may not use.
struct ExcludedRest {
  RestingFace face;
  std::string because;   // a sentence without its full stop
  std::string obstacle;  // that would stand in the table; empty: another reason
};

struct HeldPart {
  // One face per resting orientation of the domain, in its order; empty for parts that do not rest.
  std::vector<RestingFace> faces;
  // The table; its upper face is z = 0 of FRAME_TABLE. Unset for parts that do not rest.
  std::optional<TriangleMesh> table;
  // Faces on which the part would stand, but topple too easily or put an obstacle into the table.
  std::vector<ExcludedRest> excluded;
};

// Fills in values that follow from the part: limits on offsets if none are given, the faces it
// rests on if no resting orientations are given, and the corners of its hull, which determine the
// height of the table.
// Faces that topple at 15 degrees or more are offered (3 degrees by the defaults of version 0.1);
// the others are excluded.
// INVALID_ARGUMENT: a resting part has no stable face, or is flat; the message names the file.
absl::StatusOr<HeldPart> HoldPart(const TriangleMesh& part, Inspection* inspection);

// Check of obstacles that overlap the part. A fixture (FRAME_PART) must not overlap it. An obstacle
// on the table (FRAME_TABLE) or the stage (FRAME_STAGE) must leave, for each resting orientation,
// at least one of the tried turns about the vertical without overlap; the collision check of scans
// handles the other turns. It also handles FRAME_WORLD, which stands still while the stage moves.
// For freely held parts only FRAME_PART is checked. An overlap of less than kToleratedDepth_m is
// contact.
inline constexpr double kToleratedDepth_m = 5e-4;
struct PlacedObstacle {
  const TriangleMesh* mesh;
  ObstacleFrame frame;
  std::string name;
};
// INVALID_ARGUMENT names obstacle, resting face, volume and depth.
absl::Status CheckObstaclesClear(const TriangleMesh& part, const Inspection& inspection,
                                 const HeldPart& held,
                                 const std::vector<PlacedObstacle>& obstacles);

// Excludes, from `held` and from the domain, resting faces on which an obstacle in the part's frame
// (a clamp, a fixture) would reach into the table by more than kToleratedDepth_m. Has no effect
// with the defaults of version 0.1. INVALID_ARGUMENT: no face is left.
absl::Status ExcludeBlockedRests(const TriangleMesh& part,
                                 const std::vector<PlacedObstacle>& obstacles,
                                 Inspection* inspection, HeldPart* held);

}  // namespace sightline
