// SPDX-License-Identifier: Apache-2.0
// Line drawings of a scan: where camera, laser and part stand, with the lengths and angles that are
// set.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "planner_client/exports/scan_frames.h"
#include "sightline/v1/report.pb.h"

namespace sightline {

struct DrawnScene {
  ScanFrames frames;
  // The part where it is in the middle of the scan, world coordinates; its outline is drawn as the
  // convex hull of these.
  std::vector<Eigen::Vector3d> part_points_m;
  // World positions of the centre of the part's bounding box at the first and the last trigger.
  Eigen::Vector3d centre_at_start_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d centre_at_end_m = Eigen::Vector3d::Zero();
};

// Along the laser line, in the plane that camera and laser share: polar angle of the camera,
// triangulation angle, distances. Seen so that +x, or +y where the plane lies along y, is to the
// right, as in TopView.
v1::ReportDrawing SideView(const DrawnScene& scene);

// From above: x to the right, y up; the way of the stage, and where the CAD axes point that lie
// more than 17 degrees from the vertical.
v1::ReportDrawing TopView(const DrawnScene& scene);

// Corners of the convex hull of points in a plane, counter-clockwise (Andrew's monotone chain);
// of fewer than three different points, these.
std::vector<Eigen::Vector2d> ConvexHull(std::vector<Eigen::Vector2d> points);

}  // namespace sightline
