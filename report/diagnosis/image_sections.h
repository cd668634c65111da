// SPDX-License-Identifier: Apache-2.0
// Recorded and expected images: sections of a diagnosis's report.
#pragma once

#include "report/diagnosis/diagnosis_view.h"
#include "report/document/report_parts.h"

namespace sightline {

// Profiles across the line and what is left of them. Empty: there are none.
ReportBlocks ProfileBlocks(const DiagnosisView& view);

// Maps of standardised residuals beside the recording. Empty: there are none.
ReportBlocks RegionMapBlocks(const DiagnosisView& view);

}  // namespace sightline
