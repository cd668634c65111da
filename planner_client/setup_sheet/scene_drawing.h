// SPDX-License-Identifier: Apache-2.0
// Line drawings of a scan: positions of camera, laser and part, with the lengths and angles to be
// set.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "planner_client/exports/scan_frames.h"
#include "sightline/v1/report.pb.h"

namespace sightline {

struct DrawnScene {
  ScanFrames frames;
  // Points of the part in the middle of the scan, world coordinates; their convex hull is drawn as
  // its outline.
  std::vector<Eigen::Vector3d> part_points_m;
  // World positions of the centre of the part's bounding box at the first and the last trigger.
  Eigen::Vector3d centre_at_start_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d centre_at_end_m = Eigen::Vector3d::Zero();
};

// View along the laser line of the plane that camera and laser share: polar angle of the camera,
// triangulation angle, distances. +x, or +y if the plane lies along y, points to the right, as in
// TopView.
v1::ReportDrawing SideView(const DrawnScene& scene);

// View from above: x to the right, y up. It shows the path of the stage and those CAD axes that are
// more than 17 degrees from the vertical.
v1::ReportDrawing TopView(const DrawnScene& scene);

// Corners of the convex hull of points in a plane, counter-clockwise (Andrew's monotone chain).
// Fewer than three different points are returned unchanged.
std::vector<Eigen::Vector2d> ConvexHull(std::vector<Eigen::Vector2d> points);

}  // namespace sightline
