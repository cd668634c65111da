// SPDX-License-Identifier: Apache-2.0
// Sections on what is missing, whether or not it has a name: at which stage of the chain, what it
// grows with, and the term itself.
#pragma once

#include <string>

#include "planner_client/report/diagnosis/diagnosis_view.h"

namespace sightline {

// HTML below the section's heading; empty if the diagnosis holds none.
std::string StagesHtml(const DiagnosisView& view);
std::string LawsHtml(const DiagnosisView& view);
std::string FreeFormHtml(const DiagnosisView& view);

}  // namespace sightline
