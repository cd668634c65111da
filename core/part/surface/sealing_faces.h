// SPDX-License-Identifier: Apache-2.0
// Triangles without area that close T-junctions of a surface.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "core/status/stop_check.h"

namespace sightline {

// A triangle without area. Its corners are vertices of faces with area.
struct ThinFace {
  std::array<uint32_t, 3> corners;
  // Whether the corner opposite to the edge from corner k to k + 1 lies on that edge.
  std::array<bool, 3> lies_on_edge;
};

// Marks the faces of `thin` with an edge that has only one triangle, among `surface` and the faces
// marked before. Such a triangle adds no point to the surface but closes its edges; other thin
// triangles would not be attached to the surface.
absl::StatusOr<std::vector<bool>> SealingFaces(std::span<const std::array<uint32_t, 3>> surface,
                                               std::span<const ThinFace> thin,
                                               const StopCheck& stop);

}  // namespace sightline
