// SPDX-License-Identifier: Apache-2.0
// Blocks of the set-up sheet about one scan.
#pragma once

#include <Eigen/Geometry>
#include <string>
#include <vector>

#include "core/part/mesh.h"
#include "planner_client/exports/scan_frames.h"
#include "report/document/report_parts.h"
#include "sightline/v1/plan.pb.h"

namespace sightline {

// The part as the sheet needs it, CAD coordinates.
struct SheetPart {
  explicit SheetPart(const TriangleMesh& mesh);

  const TriangleMesh& mesh;
  Eigen::AlignedBox3d box_m;
  // One vertex for each occupied cell of a grid over the part, for drawings.
  std::vector<Eigen::Vector3d> drawn_m;
};

struct SheetScan {
  const v1::Plan& plan;
  const v1::PlannedScan& scan;
  const ScanFrames& frames;
  const SheetPart& part;
  const std::string& picture_png;  // empty: none
  const std::string& face_png;     // the resting face from outside; empty: none
};

// Remarks on the scan, and whether it is kept as given.
ReportBlocks SheetRemarks(const v1::PlannedScan& scan);

// Pictures of the scan and of the resting face, side view and top view.
v1::ReportBlock SheetPictures(const SheetScan& of);

// Steps to place the part.
v1::ReportBlock SheetPartPlace(const SheetScan& of);

// Axes to check that the part is turned as intended.
v1::ReportBlock SheetPartAxes(const SheetScan& of);

// Corners of the CAD bounding box, in the machine.
v1::ReportBlock SheetCorners(const SheetScan& of);

// Positions and directions of camera and laser. For a common housing, its stand-off and turns are
// given.
v1::ReportBlock SheetSensors(const SheetScan& of, bool one_housing);

// Extent of the part in x and y with the stage at 0 [m].
Eigen::AlignedBox3d ExtentAtStageZero(const SheetPart& part, const ScanFrames& frames);

v1::ReportBlock SheetStage(const v1::PlannedScan& scan);

// Settings of camera and laser, joints of the robot and expected results, as far as the plan has
// them.
ReportBlocks SheetDetails(const v1::PlannedScan& scan);

}  // namespace sightline
