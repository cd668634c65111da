// SPDX-License-Identifier: Apache-2.0
// The data that the web viewer draws, as JSON.
#pragma once

#include <string>
#include <vector>

#include "planner_client/report/plan/sections/report_data.h"
#include "planner_client/report/plan/surface/display_mesh.h"
#include "planner_client/report/plan/surface/uncovered_regions.h"

namespace sightline {

// Numbers in metres and radians, part coordinates. Arrays are base64 of little-endian values:
// positions as uint16 steps of `quantum_m` from `origin_m`, normals as int16 / 32767, indices as
// uint32, bit sets as on the wire. viewer/data.js reads it.
std::string ViewerDataJson(const ReportData& data, const DisplayMesh& mesh,
                           const std::vector<UncoveredRegion>& regions);

}  // namespace sightline
