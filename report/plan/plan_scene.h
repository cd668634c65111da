// SPDX-License-Identifier: Apache-2.0
// Part, targets and scans for the viewer's 3-D scene.
#pragma once

#include <vector>

#include "report/plan/sections/report_data.h"
#include "report/plan/surface/display_mesh.h"
#include "report/plan/surface/uncovered_regions.h"
#include "sightline/v1/report_scene.pb.h"

namespace sightline {

// `regions`: those that rows of the report refer to.
v1::ReportScene PlanScene(const ReportData& data, const DisplayMesh& mesh,
                          const std::vector<UncoveredRegion>& regions);

}  // namespace sightline
