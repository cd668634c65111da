// SPDX-License-Identifier: Apache-2.0
// Sections of a diagnosis's report on recorded and expected images.
#pragma once

#include "report/diagnosis/diagnosis_view.h"
#include "report/document/report_parts.h"

namespace sightline {

// Profiles across the line and their residuals. Empty if there are none.
ReportBlocks ProfileBlocks(const DiagnosisView& view);

// Maps of standardised residuals beside the recording. Empty if there are none.
ReportBlocks RegionMapBlocks(const DiagnosisView& view);

}  // namespace sightline
