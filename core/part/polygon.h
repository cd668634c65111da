// SPDX-License-Identifier: Apache-2.0
// Polygons of part files as triangles.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "absl/status/status.h"
#include "core/part/mesh_readers.h"
#include "core/status/stop_check.h"

namespace sightline {

// Cuts the polygons of one file into triangles: a fan of a convex one, otherwise ears (Meisters,
// "Polygons have ears", 1975), looked for among the corners that could lie in them, which a grid
// finds. That takes about linear time where ears are small against the polygon and quadratic time
// at worst, so what one file may cost is limited.
class PolygonCutter {
 public:
  // Steps of work (a corner or a cell of the grid looked at) for the polygons with more than
  // `kFewCorners` corners of one file: some five seconds.
  static constexpr int64_t kMostSteps = 1'000'000'000;
  static constexpr size_t kFewCorners = 32;
  // Corners of one face. Cutting takes some 60 bytes for each, and no outline that was drawn or
  // tessellated has as many.
  static constexpr size_t kMostCorners = 1'000'000;

  explicit PolygonCutter(const StopCheck& stop) : stop_(stop) {}

  // Adds the triangles of a planar polygon given by indices into mesh->positions. Fewer than 3
  // corners add nothing; a polygon that crosses itself is fanned where it has no ear.
  // INVALID_ARGUMENT: more than kMostCorners corners, more than kMaxTriangles triangles with those
  // of `mesh`, or the file's polygons are too much work; or what `stop` says.
  absl::Status Add(std::span<const uint32_t> corners, RawMesh* mesh);

 private:
  absl::Status CutEars(std::span<const uint32_t> corners,
                       std::span<const std::array<double, 2>> places, RawMesh* mesh);

  const StopCheck& stop_;
  int64_t steps_ = 0;
};

}  // namespace sightline
