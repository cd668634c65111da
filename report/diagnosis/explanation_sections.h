// SPDX-License-Identifier: Apache-2.0
// Sections of a diagnosis's report about explanations of the recordings.
#pragma once

#include "report/diagnosis/diagnosis_view.h"
#include "report/document/report_parts.h"

namespace sightline {

// All results are empty if the diagnosis has no data for them. ExplanationBlocks: explanations by
// probability, with fitted values, and groups that the data cannot distinguish.
ReportBlocks ExplanationBlocks(const DiagnosisView& view);
ReportBlocks NextRecordingBlocks(const DiagnosisView& view);
// Strength above which each effect would have been detected.
ReportBlocks PowerBlocks(const DiagnosisView& view);

}  // namespace sightline
