// SPDX-License-Identifier: Apache-2.0
// Moves the surface of a mesh along its normals, to represent a part as it was measured.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "core/part/mesh.h"

namespace sightline {

// The surface's deviation at places on it; arrays of one length.
struct DeviationField {
  std::vector<Eigen::Vector3f> positions_m;
  std::vector<Eigen::Vector3f> normals;
  std::vector<double> deviations_m;  // 0 where nothing is known
  double spacing_m = 0.005;          // of the places
};

// Vertices move along their normals (mean of their triangles' normals, by area) by the mean of the
// deviations around them that belong to surface facing their way, with Gaussian weights of half the
// spacing as standard deviation, out to twice the spacing; without such a place not at all. Edges
// that come near a deviation that is not 0 are first halved until they are no longer than the
// spacing, both their triangles alike, so that a bump in the middle of a large triangle shows and
// no gap opens. The refinement ends early above `most_triangles`. Materials go with their
// triangles; a mesh without deviations comes back as it is.
TriangleMesh DeformMesh(const TriangleMesh& mesh, const DeviationField& field,
                        size_t most_triangles = 4'000'000);

}  // namespace sightline
