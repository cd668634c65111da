// SPDX-License-Identifier: Apache-2.0
// Sections on how well the model fits, and what it made of the set-up.
#pragma once

#include <string>

#include "planner_client/report/diagnosis/diagnosis_view.h"

namespace sightline {

// HTML below the section's heading; empty if the diagnosis holds none.
std::string FitHtml(const DiagnosisView& view);
std::string DeviationsHtml(const DiagnosisView& view);

}  // namespace sightline
