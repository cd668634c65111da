// SPDX-License-Identifier: Apache-2.0
// Why toleranced surface is not known well enough: what limits the uncertainty of its targets.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/targets/target_set.h"
#include "report/uncertainty/target_uncertainty.h"
#include "sightline/v1/plan.pb.h"

namespace sightline {

// The limit of each toleranced target whose uncertainty is above the admissible one, UNSPECIFIED of
// the others. `points`: measured points within the neighbourhood of each target. The largest part
// of u decides; noise is taken apart further by comparison with the medians of the covered targets
// of the same region of interest that are known well enough, if there are such (regions may differ
// in resolution). u^2 of noise goes with the points' variance over their number, so of the factors
//   (number there) / (number here), (variance here) / (there), (admissible u^2 there) / (here)
// the largest is named.
// `regions`: of each target, -1 for none.
std::vector<v1::UncertaintyLimit> UncertaintyLimits(const TargetUncertainties& uncertainties,
                                                    const TargetBits& measurable,
                                                    const TargetBits& covered,
                                                    std::span<const int32_t> points,
                                                    std::span<const int32_t> regions);

// Targets by what limits them (TargetUncertainties::limits), most frequent first, with the median
// of u over the admissible one.
std::vector<v1::InadmissibleCount> CountInadmissible(const TargetUncertainties& uncertainties);

// "errors of calibration", and "a better calibration".
std::string LimitWords(v1::UncertaintyLimit limit);
std::string WhatHelps(v1::UncertaintyLimit limit);

// "150 toleranced targets are not known well enough: ... (120, u 1.4 times the admissible), ...\n";
// empty: none.
std::string SummariseInadmissible(const v1::PlanUncertainty& uncertainty);

}  // namespace sightline
