// SPDX-License-Identifier: Apache-2.0
// How finely and under which angles each scan measures.
#pragma once

#include <string>

#include "sightline/v1/plan.pb.h"

namespace sightline {

// A section of the report; empty if no scan of the plan has a quality.
std::string QualitySection(const v1::Plan& plan);

}  // namespace sightline
