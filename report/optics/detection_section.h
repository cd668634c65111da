// SPDX-License-Identifier: Apache-2.0
// Sections of the optical report about what planning of the geometry takes from it.
#pragma once

#include "report/document/report_parts.h"
#include "sightline/v1/optics.pb.h"

namespace sightline {

// The learned u over distance and angle of incidence, with its relative standard errors, as a
// table. Empty: nothing was learned.
ReportBlocks DetectionBlocks(const v1::OpticsChoice& choice);

// Geometry and setting planned in turn, a line per round. Empty: there was no such planning.
ReportBlocks RoundBlocks(const v1::OpticsPlan& optics);

}  // namespace sightline
