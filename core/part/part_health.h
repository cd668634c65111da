// SPDX-License-Identifier: Apache-2.0
// Health report of a part's mesh.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/part/mesh.h"

namespace sightline {

struct PartHealth {
  int64_t triangle_count = 0;
  int64_t vertex_count = 0;
  double area_m2 = 0;
  Eigen::AlignedBox3d bounding_box_m;
  int64_t open_edge_count = 0;          // edges with one triangle
  int64_t non_manifold_edge_count = 0;  // edges with more than two
  // Triangles without area, with those that reading the file left out.
  int64_t degenerate_triangle_count = 0;
  int64_t duplicate_triangle_count = 0;
  int64_t component_count = 0;
  int64_t flipped_component_count = 0;
  // Findings that matter for planning, in words; empty for a sound part.
  std::vector<std::string> findings;
};

// Works on welded meshes (LoadPart). A closed component counts as flipped if its signed volume has
// the wrong sign for its nesting depth (voids inside material rightly point into the void).
PartHealth CheckPartHealth(const TriangleMesh& mesh);

}  // namespace sightline
