// SPDX-License-Identifier: Apache-2.0
// Effort of a plan: its execution, its computation, and the comparison with other strategies.
#pragma once

#include "report/document/report_parts.h"
#include "report/plan/sections/report_data.h"
#include "sightline/v1/plan.pb.h"

namespace sightline {

ReportBlocks CostBlocks(const v1::Plan& plan);
ReportBlocks TimingBlocks(const ReportData& data);
ReportBlocks ComparisonBlocks(const ComparisonTable& table);

}  // namespace sightline
