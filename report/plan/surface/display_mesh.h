// SPDX-License-Identifier: Apache-2.0
// Prepares a part's mesh for colouring in a browser.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "core/part/mesh.h"
#include "core/targets/target_set.h"

namespace sightline {

// Vertices are split at sharp edges, so that each has one normal. Metres, part
// coordinates.
struct DisplayMesh {
  std::vector<Eigen::Vector3f> positions_m;
  std::vector<Eigen::Vector3f> normals;
  std::vector<uint32_t> nearest_target;  // per vertex; empty if there are no targets
  std::vector<std::array<uint32_t, 3>> triangles;
  // End points of sharp (more than 40 degrees) and open edges.
  std::vector<std::array<Eigen::Vector3f, 2>> feature_edges_m;
  bool simplified = false;
};

// Halves edges until none is longer than `max_edge_m`: the triangles of CAD tessellations can be as
// long as the part, too coarse for colours. Neighbours stay joined without gaps. The vertices of
// `mesh` come first.
TriangleMesh SubdivideLongEdges(const TriangleMesh& mesh, double max_edge_m);

// Meshes with more than `max_triangles` (> 0) are simplified. All meshes are refined towards the
// spacing of the targets within that budget (a mesh that resists simplification may exceed it). The
// nearest target of a vertex must lie on a surface that faces the same way.
DisplayMesh MakeDisplayMesh(const TriangleMesh& mesh, const TargetSet& targets, double spacing_m,
                            size_t max_triangles);

}  // namespace sightline
