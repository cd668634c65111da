// Whether camera and laser of a scan would stand in the same place.
#pragma once

#include "core/rig/rig.h"
#include "core/rig/scan_geometry.h"

namespace sightline {

// How far [m] the bodies of camera and laser reach into one another: of the pair that does so most,
// the shortest way that takes it apart; 0: none do. Exact for boxes (separating axes), of which a
// cylinder is taken as a prism of eight sides around it.
double SensorBodyOverlap(const Rig& rig, const ScanGeometry& geometry);

}  // namespace sightline
