// SPDX-License-Identifier: Apache-2.0
// Tables of the optical report: settings by f-number, by freedom and by scan, frames, devices.
#pragma once

#include <string>

#include "report/document/report_parts.h"
#include "report/optics/optics_charts.h"
#include "sightline/v1/catalogue.pb.h"
#include "sightline/v1/optics.pb.h"

namespace sightline {

// Text of an interval; empty if it is unknown.
std::string UPxInterval(const v1::OpticsPoint& point);
std::string RealUPxInterval(const v1::OpticsPoint& point);
std::string CoverageInterval(const v1::OpticsPoint& point);
std::string CostInterval(const v1::OpticsPoint& point);

// All of them are empty if the plan has no data for them.
ReportBlocks CurveTableBlocks(const OpticsCurve& curve);
ReportBlocks AlternativeBlocks(const v1::OpticsPlan& optics, const v1::OpticsPoint* best);
ReportBlocks ScanSettingBlocks(const v1::OpticsPlan& optics, const v1::OpticsPoint* best);
ReportBlocks FrameBlocksOf(const v1::OpticsPlan& optics);
// At most 200 combinations.
ReportBlocks DeviceBlocks(const v1::DeviceChoice* devices);

}  // namespace sightline
