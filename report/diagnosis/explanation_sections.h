// SPDX-License-Identifier: Apache-2.0
// Sections of a diagnosis's report about explanations of the recordings.
#pragma once

#include "report/diagnosis/diagnosis_view.h"
#include "report/document/report_parts.h"

namespace sightline {

// All of them are empty where the diagnosis has nothing to say.
// Explanations by probability, with fitted values, and which of them cannot be told apart.
ReportBlocks ExplanationBlocks(const DiagnosisView& view);
ReportBlocks NextRecordingBlocks(const DiagnosisView& view);
// Strength from which on each effect would have been seen.
ReportBlocks PowerBlocks(const DiagnosisView& view);

}  // namespace sightline
