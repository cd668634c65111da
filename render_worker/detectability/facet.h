// SPDX-License-Identifier: Apache-2.0
// A flat facet with the laser line on it, seen and lit from given directions.
#pragma once

#include "core/part/mesh.h"
#include "core/rig/measurement.h"
#include "core/rig/rig.h"
#include "render_worker/frame/frame_setup.h"

namespace sightline {

// Directions from the facet: angles between its normal and camera or laser, and between the two
// about the normal (v1::DetectabilityOfMaterial).
struct FacetView {
  double camera_distance_m = 0;
  double camera_incidence_rad = 0, laser_incidence_rad = 0;
  double azimuth_rad = 0;
};

// A square about the origin in the plane z = 0, its normal along z.
TriangleMesh FacetMesh(double half_edge_m);

// The scan whose camera and laser stand there when the facet's centre lies in the rig's origin, at
// stage position 0: the camera above, the laser beside it, the facet turned.
Measurement MeasurementOf(const FacetView& view);

// Pixels about the line's middle: fewer columns and more rows where the line is steep in the image.
// Even numbers, so that a Bayer cell stays whole.
RegionOfInterest RegionAboutLine(const Rig& rig, const Measurement& measurement);

}  // namespace sightline
