// SPDX-License-Identifier: Apache-2.0
// Sections of the optical report on results that geometry planning uses.
#pragma once

#include "report/document/report_parts.h"
#include "sightline/v1/optics.pb.h"

namespace sightline {

// Table of the learned u over distance and angle of incidence, with relative standard errors. Empty
// if no detection was learned.
ReportBlocks DetectionBlocks(const v1::OpticsChoice& choice);

// Alternating rounds of planning geometry and setting, one line each. Empty without such rounds.
ReportBlocks RoundBlocks(const v1::OpticsPlan& optics);

}  // namespace sightline
