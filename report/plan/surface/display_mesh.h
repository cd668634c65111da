// SPDX-License-Identifier: Apache-2.0
// A part's mesh made fit for colouring in a browser.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "core/part/mesh.h"
#include "core/targets/target_set.h"

namespace sightline {

// Vertices are split where the surface has an edge, so each has one normal. Metres, part
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

// Halves edges longer than `max_edge_m` until none is left: CAD tessellations have triangles as
// long as the part, too coarse to carry colours. Neighbours stay joined without gaps. The first
// vertices are those of `mesh`.
TriangleMesh SubdivideLongEdges(const TriangleMesh& mesh, double max_edge_m);

// Larger meshes than `max_triangles` (> 0) are simplified, all are refined towards the spacing of
// the targets as far as that budget allows (a mesh that resists simplification may exceed it). A
// vertex's nearest target is looked for on surface that faces the same way.
DisplayMesh MakeDisplayMesh(const TriangleMesh& mesh, const TargetSet& targets, double spacing_m,
                            size_t max_triangles);

}  // namespace sightline
