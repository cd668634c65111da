// SPDX-License-Identifier: Apache-2.0
// The robot of a plan: a section of the report, and what the scene shows of it.
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <string>
#include <vector>

#include "report/document/report_parts.h"
#include "sightline/v1/plan.pb.h"

namespace sightline {

// A solid of the robot in a frame of its own; exactly one of the three is given.
struct ReportSolid {
  Eigen::Vector3d box_m = Eigen::Vector3d::Zero();  // full edge lengths
  // Cylinder along z with the origin in the middle; a length of 0 means a sphere.
  double radius_m = 0, length_m = 0;
  std::vector<std::array<Eigen::Vector3f, 3>> triangles_m;
};

struct ReportRobot {
  std::string name;
  struct Joint {
    std::string name;
    bool rotary = true;
  };
  std::vector<Joint> joints;
  std::vector<ReportSolid> solids;
  // Poses of the solids at the start and at the end of a scan, in part coordinates at the current
  // stage position; none if the robot cannot make it.
  struct ScanPoses {
    std::vector<Eigen::Isometry3d> start, end;
  };
  std::vector<ScanPoses> scans;
};

// Joint positions and times, and unreachable scans with reasons. Needs one entry of robot.scans and
// one RobotScan per scan of the plan.
ReportBlocks RobotBlocks(const v1::Plan& plan, const ReportRobot& robot);

}  // namespace sightline
