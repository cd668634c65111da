// SPDX-License-Identifier: Apache-2.0
// Points that a scan measures on an artefact, for the nominal geometry of the rig.
#pragma once

#include <Eigen/Core>
#include <numbers>
#include <vector>

#include "absl/status/status.h"
#include "core/acceptance/artefact.h"
#include "core/rig/rig.h"
#include "core/rig/scan_geometry.h"
#include "core/triangulation/triangulation.h"

namespace sightline {

struct ArtefactPoint {
  int surface = 0;  // of the artefact
  int frame = 0;    // of the scan
  int column_px = 0;
  double row_px = 0;
  Eigen::Vector3d position_m;
  Eigen::Vector3d normal;  // along which the signed distance grows
  double distance_m = 0;   // from the camera
  double incidence_rad = 0;
  double slope_m_per_px = 0;  // of the signed distance, along the image column
};

struct ArtefactFrame {
  double stage_m = 0;
  TriangulationSetup setup;  // in coordinates of the artefact
};

struct ArtefactScan {
  std::vector<ArtefactFrame> frames;
  std::vector<ArtefactPoint> points;  // by frame, then by column
};

// Limits on the places whose points count.
struct SightLimits {
  double most_incidence_rad = 70 * std::numbers::pi / 180;  // to camera and laser
  double max_range_m = 1.5;
  // Approximate limit on the points per surface; beyond it, columns are left out evenly.
  int most_points = 5000;
};

// Camera and laser with the stage at `stage_m`.
TriangulationSetup SetupAt(const Rig& rig, const ScanGeometry& geometry, double stage_m);

// OUT_OF_RANGE: points of the artefact that face camera and laser lie outside the image, the
// laser's fan, the range or the travel of the stage; the message names the limit and the fraction
// of the surface. Also if no point faces both.
absl::Status FitsIntoField(const Rig& rig, const ScanGeometry& geometry, const Artefact& artefact,
                           const SightLimits& limits);

// Pixel centres are at whole numbers, as in rendered images.
ArtefactScan ScanArtefact(const Rig& rig, const ScanGeometry& geometry, const Artefact& artefact,
                          const SightLimits& limits);

// Leaves out columns of every surface evenly until at most `most_points` points of it are left.
void ThinColumns(int most_points, ArtefactScan* scan);

}  // namespace sightline
