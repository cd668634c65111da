// SPDX-License-Identifier: Apache-2.0
// Sections of a diagnosis's report on the term that the nominal description lacks.
#pragma once

#include "report/diagnosis/diagnosis_view.h"
#include "report/document/report_parts.h"

namespace sightline {

// All of them are empty if the diagnosis has no data for them.
ReportBlocks StageBlocks(const DiagnosisView& view);
ReportBlocks LawBlocks(const DiagnosisView& view);
ReportBlocks FreeFormBlocks(const DiagnosisView& view);

}  // namespace sightline
