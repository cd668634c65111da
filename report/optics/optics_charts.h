// SPDX-License-Identifier: Apache-2.0
// Charts of an optical plan: the performance of each f-number (thesis, Figs. 6.10 and 6.12 to
// 6.14), and cost against exposure time.
#pragma once

#include <vector>

#include "report/document/report_parts.h"
#include "sightline/v1/optics.pb.h"

namespace sightline {

struct OpticsCurve {
  std::vector<const v1::OpticsPoint*> points;  // by f-number
  const v1::OpticsPoint* best = nullptr;       // may be null
  double longest_exposure_time_s = 0;          // 0: no limit
};

// True if the point is the best one of the curve, or indistinguishable from it.
bool AsGoodAsBest(const OpticsCurve& curve, const v1::OpticsPoint& point);

// Empty without points.
ReportBlocks FNumberBlocks(const OpticsCurve& curve);

// Empty if no exposure times were stored. Draws at most 12 f-numbers.
ReportBlocks ExposureBlocks(const OpticsCurve& curve);

}  // namespace sightline
