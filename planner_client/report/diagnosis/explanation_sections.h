// SPDX-License-Identifier: Apache-2.0
// Sections on explanations: how probable each is, what would tell them apart, and what could have
// been found at all.
#pragma once

#include <string>

#include "planner_client/report/diagnosis/diagnosis_view.h"

namespace sightline {

// HTML below the section's heading; empty if the diagnosis holds none.
std::string ExplanationsHtml(const DiagnosisView& view);
std::string NextRecordingsHtml(const DiagnosisView& view);
std::string PowerHtml(const DiagnosisView& view);

}  // namespace sightline
