// SPDX-License-Identifier: Apache-2.0
// How well models fit: sections of a diagnosis's report.
#pragma once

#include "report/diagnosis/diagnosis_view.h"
#include "report/document/report_parts.h"

namespace sightline {

// Chi squared by kind of observable and by recording, and the intensity error. Empty: no fits.
ReportBlocks FitBlocks(const DiagnosisView& view);

// The set-up's fitted deviations over their stated uncertainties. Empty: there are none.
ReportBlocks DeviationBlocks(const DiagnosisView& view);

}  // namespace sightline
