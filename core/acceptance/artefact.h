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
      Eigen::Vector3d::Zero();  // the place that points most towards camera and laser
};

enum class ArtefactKind { kSphere, kBallBar, kPlate, kRing, kHolePattern };

struct Artefact {
  ArtefactKind kind = ArtefactKind::kSphere;
  std::string name;  // "ball bar along the stage"
  std::vector<ArtefactSurface> surfaces;
};

// Unit normal on the side of the air.
Eigen::Vector3d AirNormal(const ArtefactSurface& surface, const Eigen::Vector3d& point_m);

// Points of the surface where a line meets it, both ways, inside its borders.
std::vector<Eigen::Vector3d> Crossings(const ArtefactSurface& surface,
                                       const Eigen::Vector3d& point_m,
                                       const Eigen::Vector3d& direction);

// Whether the surface faces `from` at the point, at most `most_incidence_rad` off its normal, and
// does not hide the point from there.
bool IsSeen(const ArtefactSurface& surface, const Eigen::Vector3d& point_m,
            const Eigen::Vector3d& from_m, double most_incidence_rad);

// Points all over the surface, about `count`.
std::vector<Eigen::Vector3d> SamplePoints(const ArtefactSurface& surface, int count);

// Lengths are above 0. The middle of what camera and laser see is where they meet. A bore has its
// axis 50 degrees off the bisector of camera and laser and is a quarter of its diameter long.
Artefact MakeSphere(const ScanGeometry& geometry, double diameter_m);
Artefact MakePlate(double side_m);
Artefact MakeRing(const ScanGeometry& geometry, double diameter_m);
// Four bores like that of the ring, at the corners of a square of that side across their axis. The
// pattern is measured in two set-ups, between which it is turned by half a turn about the bores'
// axis: bore k lies where bore OppositeBore(k) lay, and another side of its wall is seen.
Artefact MakeHolePattern(const ScanGeometry& geometry, double side_m, double bore_diameter_m);
inline int OppositeBore(int bore) { return (bore + 2) % 4; }
// One bar in four directions: along the laser line, along the stage, between both, and along the
// line 30 degrees off the horizontal.
std::vector<Artefact> MakeBallBars(const ScanGeometry& geometry, double length_m,
                                   double diameter_m);

}  // namespace sightline
