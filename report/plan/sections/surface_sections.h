// SPDX-License-Identifier: Apache-2.0
// Sections on the part and its surface: unmeasured and unmeasurable regions.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "report/document/report_parts.h"
#include "report/plan/sections/report_data.h"
#include "report/plan/surface/uncovered_regions.h"

namespace sightline {

// `regions`: the listed ones of `region_count`; `uncovered`: measurable targets in all of them.
ReportBlocks UncoveredBlocks(const ReportData& data, const std::vector<UncoveredRegion>& regions,
                             size_t region_count, int64_t uncovered);

ReportBlocks MeasurabilityBlocks(const ReportData& data);

// Size and health of the mesh.
ReportBlocks PartBlocks(const ReportData& data);

}  // namespace sightline
