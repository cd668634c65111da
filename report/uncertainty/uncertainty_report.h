// SPDX-License-Identifier: Apache-2.0
// The report of a plan for uncertainty, besides coverage: how much of the surface is
// known well enough, which tolerances can be proven, and why not.
#pragma once

#include <string>
#include <vector>

#include "core/targets/target_set.h"
#include "report/document/report_parts.h"
#include "report/uncertainty/target_uncertainty.h"
#include "sightline/v1/plan.pb.h"

namespace sightline {

// Standard uncertainties as people read them: "12.3 µm", "1.25 mm"; "–" if not a number or
// infinite.
std::string LengthText(double length_m);

// The answer in a sentence or two. The plan has `uncertainty`. `why_stopped`: said if the goal was
// missed.
std::vector<v1::ReportRun> UncertaintyFinding(const v1::Plan& plan, const std::string& why_stopped);

// Headline numbers.
std::vector<v1::ReportFact> UncertaintyFigures(const v1::Plan& plan);

// Fraction of the toleranced targets that is admissible, and at most relaxed, after each scan, with
// the goal and the bound on the number of scans (thesis Fig. 6.4).
ReportBlocks UncertaintyCurveBlocks(const v1::Plan& plan);

// Every toleranced feature: those that are not evaluated, those that cannot be proven, then the
// others; of each kind the one that misses or keeps its admissible uncertainty by least first.
// Empty without features. `selectable`: rows refer to the scene's features by their index in the
// plan.
ReportBlocks FeatureBlocks(const v1::Plan& plan, bool selectable);

// The verdicts as lines for a terminal, each with its reason: first how many tolerances can be
// proven and how many are not evaluated. Empty without features; at most 100 verdicts.
std::string SummariseVerdicts(const v1::PlanUncertainty& uncertainty);

// Toleranced targets that are not admissible, by what limits them (TargetUncertainties::limits).
ReportBlocks InadmissibleBlocks(const TargetUncertainties& uncertainties,
                                const TargetBits& measurable);

}  // namespace sightline
