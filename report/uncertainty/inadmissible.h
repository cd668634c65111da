// SPDX-License-Identifier: Apache-2.0
// Causes of insufficient knowledge of a toleranced surface: the limits on its targets' uncertainty.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/targets/target_set.h"
#include "report/uncertainty/target_uncertainty.h"
#include "sightline/v1/plan.pb.h"

namespace sightline {

// Limit of each toleranced target whose uncertainty exceeds the admissible one; UNSPECIFIED for all
// others. `points`: measured points within the neighbourhood of each target. The largest component
// of u determines the limit. Noise is analysed further by comparison with the medians of covered
// targets with admissible uncertainty in the same region of interest, if any (regions may differ in
// resolution). Since u^2 of noise is proportional to the points' variance over their number, the
// limit is the largest of the factors
//   (number there) / (number here), (variance here) / (there), (admissible u^2 there) / (here).
// `regions`: region of each target, -1 for none.
std::vector<v1::UncertaintyLimit> UncertaintyLimits(const TargetUncertainties& uncertainties,
                                                    const TargetBits& measurable,
                                                    const TargetBits& covered,
                                                    std::span<const int32_t> points,
                                                    std::span<const int32_t> regions);

// Counts targets by their limit (TargetUncertainties::limits), most frequent first, with the median
// ratio of u to the admissible uncertainty.
std::vector<v1::InadmissibleCount> CountInadmissible(const TargetUncertainties& uncertainties);

// "errors of calibration", and "a better calibration".
std::string LimitWords(v1::UncertaintyLimit limit);
std::string WhatHelps(v1::UncertaintyLimit limit);

// "150 toleranced targets are not known well enough: ... (120, u 1.4 times the admissible), ...\n";
// empty: none.
std::string SummariseInadmissible(const v1::PlanUncertainty& uncertainty);

}  // namespace sightline
