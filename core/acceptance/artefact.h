// SPDX-License-Identifier: Apache-2.0
// Virtual artefacts of acceptance tests: sphere, ball bar, flat plate, ring gauge and hole pattern,
// placed where camera and laser of a rig meet (ISO 10360-13; VDI/VDE 2634-2).
//
// Coordinates are those of the world with the stage at 0 (core/rig/scan_geometry.h). Artefacts do
// not turn: they travel with the stage along x.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "core/association/nominal_surface.h"
#include "core/rig/rig.h"
#include "core/rig/scan_geometry.h"

namespace sightline {

// A measured surface of an artefact: a whole sphere, a square of a plane, a section of a bore.
struct ArtefactSurface {
  NominalSurface nominal;
  bool hollow = false;                                // material is outside the nominal surface
  Eigen::Vector3d side_x = Eigen::Vector3d::UnitX();  // plane: unit vectors along its sides
  Eigen::Vector3d side_y = Eigen::Vector3d::UnitY();
  double half_side_m = 0;    // plane
  double half_length_m = 0;  // bore, along its axis from point_m
  Eigen::Vector3d reference_m =
      Eigen::Vector3d::Zero();  // point whose normal is nearest to camera and laser
};

enum class ArtefactKind { kSphere, kBallBar, kPlate, kRing, kHolePattern };

struct Artefact {
  ArtefactKind kind = ArtefactKind::kSphere;
  std::string name;  // "ball bar along the stage"
  std::vector<ArtefactSurface> surfaces;
};

// Unit normal, out of the material.
Eigen::Vector3d AirNormal(const ArtefactSurface& surface, const Eigen::Vector3d& point_m);

// Intersections of a line (in both directions) with the surface, within its borders.
std::vector<Eigen::Vector3d> Crossings(const ArtefactSurface& surface,
                                       const Eigen::Vector3d& point_m,
                                       const Eigen::Vector3d& direction);

// True if the point is visible from `from`: with an incidence of at most `most_incidence_rad`, and
// not hidden by the surface itself.
bool IsSeen(const ArtefactSurface& surface, const Eigen::Vector3d& point_m,
            const Eigen::Vector3d& from_m, double most_incidence_rad);

// Points all over the surface, about `count`.
std::vector<Eigen::Vector3d> SamplePoints(const ArtefactSurface& surface, int count);

// Lengths are above 0. The middle of the visible surface lies where camera and laser meet. The axis
// of a bore is 50 degrees off the bisector of camera and laser; its length is a quarter of its
// diameter.
Artefact MakeSphere(const ScanGeometry& geometry, double diameter_m);
Artefact MakePlate(double side_m);
Artefact MakeRing(const ScanGeometry& geometry, double diameter_m);
// Four bores like that of the ring, at the corners of a square of side `side_m` across their axis.
// The pattern is measured in two set-ups and turned by 180 degrees about the bores' axis between
// them. In the second set-up bore k lies where bore OppositeBore(k) lay, and the other side of its
// wall is seen.
Artefact MakeHolePattern(const ScanGeometry& geometry, double side_m, double bore_diameter_m);
inline int OppositeBore(int bore) { return (bore + 2) % 4; }
// One bar in four directions: along the laser line, along the stage, between both, and along the
// line 30 degrees off the horizontal.
std::vector<Artefact> MakeBallBars(const ScanGeometry& geometry, double length_m,
                                   double diameter_m);

}  // namespace sightline
