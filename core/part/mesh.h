// SPDX-License-Identifier: Apache-2.0
// Triangle mesh of a part or obstacle.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace sightline {

// Indexed triangles, counter-clockwise seen from outside; positions in metres. In a mesh that was
// read from a file, every position is a corner of a triangle with area
// (core/part/surface/normalise.h), so size, hull and resting faces may be taken from the positions.
struct TriangleMesh {
  std::vector<Eigen::Vector3f> positions_m;
  std::vector<std::array<uint32_t, 3>> triangles;
  // Index into material_names for every triangle; empty if the file names no materials.
  std::vector<uint16_t> triangle_material;
  std::vector<std::string> material_names;
  // Triangles without area that were in the file and are not in `triangles`; for the health report.
  int64_t left_out_triangles = 0;
  // The reader's choices where the file leaves something open, a sentence each.
  std::vector<std::string> remarks;

  // Bounding box of all vertices. Empty box for an empty mesh.
  Eigen::AlignedBox3d BoundingBox() const;
  // Corner c (0..2) of triangle t.
  Eigen::Vector3d Corner(size_t t, int c) const {
    return positions_m[triangles[t][c]].cast<double>();
  }
  // Outward unit normal of triangle t; zero vector for a degenerate triangle.
  Eigen::Vector3d Normal(size_t t) const;
  double Area(size_t t) const;
};

}  // namespace sightline
