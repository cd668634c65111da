// SPDX-License-Identifier: Apache-2.0
// Section on the resolution and the angles of each scan.
#pragma once

#include "report/document/report_parts.h"
#include "sightline/v1/plan.pb.h"

namespace sightline {

// Empty if no scan of the plan has a quality.
ReportBlocks QualityBlocks(const v1::Plan& plan);

}  // namespace sightline
