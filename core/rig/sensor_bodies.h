// SPDX-License-Identifier: Apache-2.0
// Positions of the bodies of camera and laser in a scan, and whether there is room for both.
#pragma once

#include "core/rig/rig.h"
#include "core/rig/scan_geometry.h"
#include "core/rig/zonotope.h"

namespace sightline {

// A body in the frame that the pose is given in. Exact for boxes; a cylinder is enclosed in a prism
// of eight sides.
Zonotope BodyAt(const Body& body, const SensorPose& pose);

// The body with a margin on every side: it covers all that is nearer to the body than the margin,
// and up to sqrt(3) times as much at its corners.
Body WithMargin(const Body& body, double margin_m);

// How far [m] the bodies of camera and laser reach into one another: of the pair that does so most,
// the shortest way that takes it apart; 0: none do. Exact for the solids of BodyAt (separating
// axes). Depends on camera distance, laser distance and triangulation angle alone.
double SensorBodyOverlap(const Rig& rig, const ScanGeometry& geometry);

// Whether they cannot both stand there. Bodies that are drawn as touching may.
bool SensorBodiesCollide(const Rig& rig, const ScanGeometry& geometry);

}  // namespace sightline
