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
  // One for every resting orientation of the domain, in its order; empty of parts that do not rest.
  std::vector<RestingFace> faces;
  // Its upper face is z = 0 of FRAME_TABLE. Unset of parts that do not rest.
  std::optional<TriangleMesh> table;
  // Faces on which the part would stand, but topples too easily or has an obstacle in the table.
  std::vector<ExcludedRest> excluded;
};

// Fills in what an inspection leaves to the part: how far it is shifted where no offsets are given,
// the faces it rests on where no resting orientations are given, and the corners of its hull, which
// the table's height follows from.
// It offers the faces it finds that topple at 15 degrees or more (3 degrees by the defaults of
// version 0.1); the others are excluded.
// INVALID_ARGUMENT if a resting part has no stable face, or is flat; the message names the file.
absl::StatusOr<HeldPart> HoldPart(const TriangleMesh& part, Inspection* inspection);

// Obstacles that reach into the part. A fixture (FRAME_PART) must not at all; what lies on the
// table (FRAME_TABLE) or travels with the stage (FRAME_STAGE) must not in every turn about the
// vertical that was tried, for each resting orientation; turns in which it does are left to the
// scans' collision check. FRAME_WORLD stands elsewhere while the stage moves: the collision check
// of every scan sees it. Of parts held freely FRAME_PART alone is checked. Reaching less than
// kToleratedDepth_m is contact.
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

// Excludes the resting faces on which an obstacle in the part's frame (a clamp, a fixture) would
// reach into the table by more than kToleratedDepth_m, from `held` and from the domain. Nothing by
// the defaults of version 0.1. INVALID_ARGUMENT if no face is left.
absl::Status ExcludeBlockedRests(const TriangleMesh& part,
                                 const std::vector<PlacedObstacle>& obstacles,
                                 Inspection* inspection, HeldPart* held);

}  // namespace sightline
