// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "core/tolerance/face_surface.h"

class TopoDS_Shape;

namespace sightline {

// Indexed triangles in the coordinates of the model they came from (core/part has TriangleMesh, in
// metres). Counter-clockwise seen from
// outside the material, also on the walls of closed cavities: the normal points out of the metal.
struct ShapeMesh {
  std::string name;
  std::vector<std::array<double, 3>> positions_mm;
  // Translation of the file's node: positions are stored as float metres from here. 0 for a mesh
  // within 2 m of the origin of the model, where floats are exact to 0.12 um.
  std::array<double, 3> origin_mm{};
  std::vector<std::array<std::uint32_t, 3>> triangles;
  // Index into material_names of every triangle; empty: no materials.
  std::vector<std::uint16_t> triangle_material;
  std::vector<std::string> material_names;
};

struct MeshingOptions {
  // Largest distance between a triangle and the surface it stands for. Valid: > 0.
  double chord_tolerance_mm = 0.05;
  // Largest turn of the surface normal across one facet. Valid: (0, 90].
  double angular_tolerance_deg = 15.0;
};

// Counts of a mesh's defects; all zero (area and volume apart) for a closed part.
struct MeshHealth {
  std::size_t boundary_edges = 0;        // used by one triangle only: a hole in the surface
  std::size_t non_manifold_edges = 0;    // used by three or more triangles
  std::size_t misoriented_edges = 0;     // used twice, both times in the same direction
  std::size_t degenerate_triangles = 0;  // zero area once stored as float metres
  std::size_t repeated_positions = 0;    // vertices equal to another one as float metres
  double area_mm2 = 0.0;
  double volume_mm3 = 0.0;  // signed; positive if the orientation is outward

  // Every edge belongs to exactly two triangles that run along it in opposite directions.
  bool watertight() const {
    return boundary_edges == 0 && non_manifold_edges == 0 && misoriented_edges == 0;
  }
};

// Meshes one solid (or any shape made of faces) and welds it. Vertices are shared along the edges
// of the model, not by distance: a solid whose faces share edges gives a watertight mesh whatever
// its tolerances. Triangles that collapse to a line are flipped away or dropped. Serial: same
// shape, same bytes. Coordinates are those of the shape, taken to be millimetres. Throws
// std::invalid_argument on options out of range, std::runtime_error if a face cannot be meshed.
ShapeMesh MeshShape(const TopoDS_Shape& shape, const MeshingOptions& options);

// Faces of a shape that MeshShape has meshed, in the order in which it takes them, as they are: not
// welded, each with vertices of its own in metres, rounded to a nanometre. `turned`: the other way
// round. Numbers of the faces are left 0. Throws std::runtime_error if a face has no triangulation.
std::vector<FaceTriangles> TriangulatedFaces(const TopoDS_Shape& shape, bool turned);

// Faces of a shape that MeshShape has meshed whose triangles have another area than the face, by
// more than 5 % and more than a strip of the chord tolerance along its edges: the mesher has left
// out a part of it or covered a hole. A sentence each, with the number of the face in the body and
// a corner of it in mm; at most ten, and then how many more there are.
std::vector<std::string> FacesOfOtherArea(const TopoDS_Shape& shape, const MeshingOptions& options);

// Sets the origin of a mesh that is far from the model's: the centre of its box, in whole mm.
void SetOrigin(ShapeMesh& mesh);

// Indices must be in range.
MeshHealth CheckMesh(const ShapeMesh& mesh);

}  // namespace sightline
