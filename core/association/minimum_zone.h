// SPDX-License-Identifier: Apache-2.0
// Minimum zone: the surface of a kind from which the signed distances of points have the smallest
// range (Chebyshev association; ISO 1101:2017, and the reference surfaces MZ of ISO 12781-1 for
// flatness, ISO 12180-1 for cylindricity, ISO 12181-1 for roundness).
//
// Gauss-Newton for a minimax problem (Osborne and Watson, Computer Journal 12 (1969) 63-68): from
// the least-squares surface on, distances are linearised in the surface's parameters and the linear
// problem is solved exactly (FitChebyshev). A step that does not narrow the zone is repeated within
// a trust region half as wide.
//
// The result has its certificate: weights of the points that touch either side of the zone. The
// convex combination of the distances' derivatives on one side equals that on the other, so that no
// small change of the surface narrows the zone. It is the minimum next to the least-squares
// surface; a thin zone has no other one in practice.
//
//   auto zone = FitMinimumZone(SurfaceKind::kCylinder, points_m, normals);
//   if (zone) Use(zone->width_m, zone->surface.axis);
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "core/association/nominal_surface.h"

namespace sightline {

struct ZonePoint {
  int point = 0;  // index into points_m
  // d width / d distance of the point: positive on the outer side, where the weights sum to 1, and
  // negative on the inner side, where they sum to -1.
  double weight = 0;
};

struct MinimumZone {
  NominalSurface surface;  // in the middle of the zone
  double width_m = 0;      // range of the signed distances
  // Points of the certificate; none where all points lie on the surface.
  std::vector<ZonePoint> active;
  // Width by which the linearised zone could still be narrower, at most 1e-5 of the width.
  double gap_m = 0;
};

// `points_m` and `normals` as for FitSurface, equally many. nullopt: FitSurface fails, or the gap
// does not converge within 60 steps.
std::optional<MinimumZone> FitMinimumZone(SurfaceKind kind,
                                          std::span<const Eigen::Vector3d> points_m,
                                          std::span<const Eigen::Vector3d> normals);

}  // namespace sightline
