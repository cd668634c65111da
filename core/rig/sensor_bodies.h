// SPDX-License-Identifier: Apache-2.0
// Positions of the bodies of camera and laser in a scan, and their collision with each other.
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

// Penetration depth [m] of the bodies of camera and laser: the shortest translation that separates
// the pair with the deepest overlap; 0: no overlap. Exact for the solids of BodyAt (separating
// axes). Depends only on camera distance, laser distance and triangulation angle.
double SensorBodyOverlap(const Rig& rig, const ScanGeometry& geometry);

// True if the bodies overlap; bodies that just touch do not.
bool SensorBodiesCollide(const Rig& rig, const ScanGeometry& geometry);

}  // namespace sightline
