// SPDX-License-Identifier: Apache-2.0
// Finds the triangles of a mesh that lie on features which a drawing describes by nominal geometry
// instead of faces of a model.
//
// QIF gives the position and size of every feature, and a mesh of the same part has its vertices on
// these surfaces: a triangle belongs to a feature if all three of its vertices lie on the feature's
// surface within 10 um, within the feature's extent, and if it faces the stated side. A feature is
// found as a whole or not at all: of a bore that is 20 um out of place, strips of the wall would
// still lie within 10 um.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/association/nominal_surface.h"
#include "core/part/mesh.h"
#include "core/tolerance/face_surface.h"

namespace sightline {

struct NominalFace {
  int face = 0;            // number that tolerances and datums name it by, from 1
  std::string feature;     // in words: "cylinder Hole 3 (feature 17)"
  NominalSurface surface;  // free form: none that can be found
  // Tried where no triangle lies on `surface`: a cone that opens the other way.
  std::optional<NominalSurface> alternative;
  // The part's outward normals point along the gradient of the signed distance (1) or against it
  // (-1); 0: not stated.
  int side = 0;
  // The face lies where lower_m <= direction . x <= upper_m, for each of these.
  struct Slab {
    Eigen::Vector3d direction;  // unit
    double lower_m, upper_m;
  };
  std::vector<Slab> slabs;
  // Closed boundary of a plane; fewer than three points: not stated.
  std::vector<Eigen::Vector3d> outline_m;
};

// Vertices of a triangulation lie on the model's surfaces within rounding and the file's digits.
inline constexpr double kOnNominalSurface_m = 1e-5;
// Triangles that lie this near to a face and face the same way are meant to be on it.
inline constexpr double kNearNominalSurface_m = 5e-5;

// The triangles of each face, in the order of `faces`, for features whose every face has triangles,
// and nearly all that lie within kNearNominalSurface_m. Triangles do not share vertices.
std::vector<FaceTriangles> FacesOnMesh(std::span<const NominalFace> faces,
                                       const TriangleMesh& mesh);

}  // namespace sightline
