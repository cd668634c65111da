// SPDX-License-Identifier: Apache-2.0
// The sections of a plan for uncertainty, in addition to coverage: fraction of the surface with
// admissible uncertainty, tolerances that can be proven, and reasons for the others.
#pragma once

#include <string>
#include <vector>

#include "core/targets/target_set.h"
#include "report/document/report_parts.h"
#include "report/uncertainty/target_uncertainty.h"
#include "sightline/v1/plan.pb.h"

namespace sightline {

// Readable standard uncertainty: "12.3 µm", "1.25 mm"; "–" if it is NaN or
// infinite.
std::string LengthText(double length_m);

// The answer in one or two sentences. The plan must have `uncertainty`. `why_stopped` is added if
// the goal was missed.
std::vector<v1::ReportRun> UncertaintyFinding(const v1::Plan& plan, const std::string& why_stopped);

// Headline numbers.
std::vector<v1::ReportFact> UncertaintyFigures(const v1::Plan& plan);

// Chart over scans of the fraction of toleranced targets with admissible, and at most relaxed,
// uncertainty, with the goal and the bound on the number of scans (thesis Fig. 6.4).
ReportBlocks UncertaintyCurveBlocks(const v1::Plan& plan);

// Every toleranced feature: first those that are not evaluated, then those that cannot be proven,
// then the others. Each group is sorted by descending ratio of u to the admissible uncertainty.
// Empty without features. `selectable`: rows refer to the scene's features by their index in the
// plan.
ReportBlocks FeatureBlocks(const v1::Plan& plan, bool selectable);

// The verdicts as lines for a terminal, each with its reason, after the numbers of tolerances that
// can be proven and that are not evaluated. Empty without features; at most 100 verdicts.
std::string SummariseVerdicts(const v1::PlanUncertainty& uncertainty);

// Inadmissible toleranced targets by their limit (TargetUncertainties::limits).
ReportBlocks InadmissibleBlocks(const TargetUncertainties& uncertainties,
                                const TargetBits& measurable);

}  // namespace sightline
