// SPDX-License-Identifier: Apache-2.0
// Sections of a diagnosis's report on the quality of fits.
#pragma once

#include "report/diagnosis/diagnosis_view.h"
#include "report/document/report_parts.h"

namespace sightline {

// Chi squared by kind of observable and by recording, and the intensity error. Empty: no fits.
ReportBlocks FitBlocks(const DiagnosisView& view);

// Fitted deviations of the set-up over their stated uncertainties. Empty if there are none.
ReportBlocks DeviationBlocks(const DiagnosisView& view);

}  // namespace sightline
