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
  // A vertex for each cell of a grid over the part that holds any, for drawings.
  std::vector<Eigen::Vector3d> drawn_m;
};

struct SheetScan {
  const v1::Plan& plan;
  const v1::PlannedScan& scan;
  const ScanFrames& frames;
  const SheetPart& part;
  const std::string& picture_png;  // empty: none
  const std::string& face_png;     // the face that is down, from outside; empty: none
};

// Remarks on the scan, and whether it is kept as given.
ReportBlocks SheetRemarks(const v1::PlannedScan& scan);

// Pictures of the scan and of the face that is down, side view and top view.
v1::ReportBlock SheetPictures(const SheetScan& of);

// How the part gets where it belongs, step by step.
v1::ReportBlock SheetPartPlace(const SheetScan& of);

// To check that the part is turned as meant.
v1::ReportBlock SheetPartAxes(const SheetScan& of);

// Corners of the CAD bounding box, in the machine.
v1::ReportBlock SheetCorners(const SheetScan& of);

// Places and directions of camera and laser. Those in one housing are placed by the housing's
// stand-off and turns.
v1::ReportBlock SheetSensors(const SheetScan& of, bool one_housing);

// From x to x and from y to y where the part lies at stage position 0 [m].
Eigen::AlignedBox3d ExtentAtStageZero(const SheetPart& part, const ScanFrames& frames);

v1::ReportBlock SheetStage(const v1::PlannedScan& scan);

// Settings of camera and laser, joints of the robot, and what to expect; only what the plan has.
ReportBlocks SheetDetails(const v1::PlannedScan& scan);

}  // namespace sightline
