// SPDX-License-Identifier: Apache-2.0
// The term that the nominal description lacks: sections of a diagnosis's report.
#pragma once

#include "report/diagnosis/diagnosis_view.h"
#include "report/document/report_parts.h"

namespace sightline {

// All of them are empty where the diagnosis has nothing to say.
ReportBlocks StageBlocks(const DiagnosisView& view);
ReportBlocks LawBlocks(const DiagnosisView& view);
ReportBlocks FreeFormBlocks(const DiagnosisView& view);

}  // namespace sightline
