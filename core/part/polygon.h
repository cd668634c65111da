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

// Cuts the polygons of one file into triangles: a convex polygon into a fan, others by cutting ears
// (Meisters, "Polygons have ears", 1975). A grid finds the corners that could lie in an ear. The
// time is about linear if ears are small relative to the polygon, but quadratic at worst, so the
// work for one file is limited.
class PolygonCutter {
 public:
  // Steps of work (a corner or a cell of the grid looked at) for the polygons with more than
  // `kFewCorners` corners of one file: some five seconds.
  static constexpr int64_t kMostSteps = 1'000'000'000;
  static constexpr size_t kFewCorners = 32;
  // Limit on the corners of one face. Cutting takes about 60 bytes per corner; outlines that were
  // drawn or tessellated have far fewer.
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
