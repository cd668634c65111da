// SPDX-License-Identifier: Apache-2.0
// Faces on which a part lies by itself.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "core/part/mesh.h"
#include "core/resting/convex_hull.h"

namespace sightline {

// A face of the part's convex hull, in part coordinates.
struct RestingFace {
  std::string name;
  // Turn its outward normal straight down (ScanGeometry: R_z(gamma) R_y(beta) R_x(alpha)).
  double part_alpha_rad = 0;
  double part_beta_rad = 0;
  Eigen::Vector3d normal;  // outward
  // The contact area with the table: the corners' convex hull, its centroid and area.
  std::vector<Eigen::Vector3d> outline_m;
  Eigen::Vector3d centre_m;
  double area_m2 = 0;
  // Smallest tilt that topples it: over the edge of the outline that is nearest to the foot of the
  // centre of mass, atan(distance / height). 0: it does not stand by itself.
  double stability_rad = 0;
};

// Centre of mass of a homogeneous body by the divergence theorem over its mesh, or over its hull
// where the mesh is not closed or encloses (nearly) nothing.
Eigen::Vector3d MassCentre(const TriangleMesh& mesh, const ConvexHull& hull);

// Faces on which the part stands by itself, named "A", "B", ... by falling stability; at most 12.
// Left out: faces toppled by less than 3 degrees, facets of round surfaces (from which it rolls on
// to the next), and faces less than 1 degree from another one.
std::vector<RestingFace> FindRestingFaces(const ConvexHull& hull,
                                          const Eigen::Vector3d& mass_centre_m);

// The face on which the part lies in the given orientation, whether or not it is stable. No name.
RestingFace DescribeRest(const ConvexHull& hull, const Eigen::Vector3d& mass_centre_m,
                         double part_alpha_rad, double part_beta_rad);

}  // namespace sightline
