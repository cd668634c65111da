// SPDX-License-Identifier: Apache-2.0
// The set-up sheet: pages to print and take to the machine. The first page covers all scans; then
// each set-up has a page in its order, or each scan if the plan has no set-ups.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/part/mesh.h"
#include "sightline/v1/plan.pb.h"
#include "sightline/v1/report.pb.h"

namespace sightline {

struct SetUpSheet {
  v1::Plan plan;
  std::string part_name;  // as the engineer knows it, e.g. the file name
  TriangleMesh mesh;      // part coordinates of the plan's poses
  // A picture of part, camera and laser for every scan; PNG, empty: none.
  std::vector<std::string> pictures_png;
  // A picture for each resting face of the plan, seen square-on from outside; or none at all.
  std::vector<std::string> face_pictures_png = {};
  bool one_housing = false;  // camera and laser are moved as one
};

// The sheet as data; the same plan gives the same report. Resting faces, settings and robot moves
// appear only if the plan has them. INVALID_ARGUMENT: poses as FramesOfScan, resting faces and
// scans of set-ups that the plan does not have, a mesh without vertices, or a number of pictures
// that differs from that of the scans or resting faces.
absl::StatusOr<v1::Report> SetUpReport(const SetUpSheet& sheet);

}  // namespace sightline
