// SPDX-License-Identifier: Apache-2.0
// Describes the appearance of unknown physics in a sentence.
#pragma once

#include <string>

#include "render_worker/diagnosis/selection/compare_models.h"
#include "sightline/v1/diagnosis.pb.h"

namespace sightline {

// For an answer with model-discrepancy terms: the effect of each term, with up to three
// coefficients that differ most from 0, by two standard errors or more; the dependence of the
// residual on the set-up (`diagnosis.laws`); and the distance to the nearest known effects. Empty
// for other answers. At least one hypothesis must be ranked.
std::string AppearanceText(const ModelComparison& comparison, const v1::Diagnosis& diagnosis);

}  // namespace sightline
